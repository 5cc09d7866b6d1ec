//! Tails and quantiles against values that were computed with 60 digits.

use super::close;
use crate::study::distribution::{self, Tail, Tails};

/// Relative error that is promised.
const SHARE: f64 = 1e-12;

/// Which distribution, its degrees of freedom, the argument, and both tails, by series of positive terms with 60 digits or,
/// for the smaller tail by its complement, 380.
const TAILS: &[(char, f64, f64, f64, f64, f64)] = &[
    ('F', 1.0, 1.0, 1.0, 0.5, 0.5),
    (
        'F',
        1.0,
        1.0,
        1e6,
        0.9993633804398389,
        0.0006366195601611178,
    ),
    ('F', 1.0, 1e6, 0.5, 0.5204997130413445, 0.47950028695865554),
    ('F', 1e6, 1.0, 3.0, 0.5637029916305218, 0.43629700836947816),
    (
        'F',
        1e6,
        1e6,
        1.001,
        0.6913744504289026,
        0.30862554957109745,
    ),
    ('F', 1e6, 1e6, 0.93, 1.5921109014758446e-288, 1.0),
    (
        'F',
        18.0,
        60.0,
        0.4337210375,
        0.02589359792831162,
        0.9741064020716884,
    ),
    ('F', 9.0, 60.0, 492.29, 1.0, 9.313638926027212e-53),
    (
        'F',
        3.0,
        7.0,
        1e-6,
        1.5241689050875847e-09,
        0.9999999984758311,
    ),
    ('F', 2.0, 2e5, 345.0, 1.0, 2.668519151374123e-150),
    (
        'F',
        999_999.0,
        5.0,
        0.25,
        0.0012498223641887237,
        0.9987501776358113,
    ),
    ('F', 50.0, 1e5, 12.5, 1.0, 5.77123957943101e-100),
    (
        'C',
        1.0,
        0.0,
        1e-12,
        7.978845608027324e-07,
        0.9999992021154392,
    ),
    ('C', 1.0, 0.0, 1300.0, 1.0, 1.1303728441492743e-284),
    ('C', 7.0, 0.0, 14.0, 0.9488186465869346, 0.05118135341306545),
    ('C', 1e6, 0.0, 1e6, 0.5001880631966055, 0.4998119368033945),
    ('C', 1e6, 0.0, 1_040_000.0, 1.0, 8.488159614156368e-172),
    ('C', 3e5, 0.0, 280_000.0, 4.463361175125348e-154, 1.0),
    (
        'C',
        59.0,
        0.0,
        150.0,
        0.9999999992822683,
        7.177316808927147e-10,
    ),
    (
        'T',
        1.0,
        0.0,
        12.706204736,
        0.9749999999996577,
        0.025000000000342328,
    ),
    ('T', 24.0, 0.0, 2.0639, 0.975000073673052, 0.024999926326948),
    ('T', 1e6, 0.0, 37.0, 1.0, 9.149865430901131e-300),
    ('T', 5.0, 0.0, 1e5, 1.0, 9.490167235394325e-25),
    (
        'N',
        0.0,
        0.0,
        1.959963985,
        0.9750000000268816,
        0.024999999973118442,
    ),
    (
        'N',
        0.0,
        0.0,
        8.0,
        0.9999999999999993,
        6.220960574271784e-16,
    ),
    ('N', 0.0, 0.0, 37.0, 1.0, 5.725571222524577e-300),
];

fn tails(of: char, a: f64, b: f64, x: f64) -> Tails {
    match of {
        'F' => distribution::f(x, a, b),
        'C' => distribution::chi_squared(x, a),
        'T' => distribution::t(x, a),
        _ => distribution::normal(x),
    }
}

fn quantile(of: char, a: f64, b: f64, tail: Tail) -> f64 {
    match of {
        'F' => distribution::f_quantile(tail, a, b),
        'C' => distribution::chi_squared_quantile(tail, a),
        'T' => distribution::t_quantile(tail, a),
        _ => distribution::normal_quantile(tail),
    }
}

#[test]
fn tails_and_quantiles_have_twelve_digits() {
    for &(of, a, b, x, lower, upper) in TAILS {
        let found = tails(of, a, b, x);
        close(found.lower, lower, SHARE);
        close(found.upper, upper, SHARE);
        // Of a tail that is nearly 1 few digits say where it ends.
        let tail = if lower < upper {
            Tail::Lower(lower)
        } else {
            Tail::Upper(upper)
        };
        close(quantile(of, a, b, tail), x, SHARE);
    }
}

#[test]
fn a_quantile_has_the_tail_that_was_asked_for() {
    let mut state = 1_u64;
    let mut share = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for round in 0..2000 {
        let of = ['F', 'C', 'T', 'N'][round % 4];
        let [a, b] = [share(), share()].map(|share| (10_f64.powf(6.0 * share)).round());
        let p = match round % 3 {
            0 => 10_f64.powf(-300.0 * share()),
            1 => 1.0 - 10_f64.powf(-12.0 * share()),
            _ => share(),
        };
        let x = quantile(of, a, b, Tail::Lower(p));
        if x == 0.0 {
            // Only ν = 1 and 2 reach below the smallest number.
            assert!(p < 1e-150 && (a <= 3.0 || b <= 3.0), "{of} {a} {b} {p:e}");
            continue;
        }
        let Tails { lower, upper } = tails(of, a, b, x);
        // The quantile is rounded to 1e-16 of itself, which far out is 1e-12 of its tail.
        let (found, asked) = if p < 0.5 {
            (lower, p)
        } else {
            (upper, 1.0 - p)
        };
        close(found, asked, 1e-9);
    }
}

#[test]
fn ends_are_ends() {
    assert_eq!(
        distribution::f(0.0, 3.0, 4.0),
        Tails {
            lower: 0.0,
            upper: 1.0
        }
    );
    assert_eq!(
        distribution::chi_squared(0.0, 3.0),
        Tails {
            lower: 0.0,
            upper: 1.0
        }
    );
    assert_eq!(distribution::f(1e300, 9.0, 60.0).upper, 0.0);
    assert_eq!(
        distribution::t(0.0, 5.0),
        Tails {
            lower: 0.5,
            upper: 0.5
        }
    );
    assert_eq!(distribution::f_quantile(Tail::Lower(0.0), 3.0, 4.0), 0.0);
    assert_eq!(
        distribution::f_quantile(Tail::Upper(0.0), 3.0, 4.0),
        f64::INFINITY
    );
    assert_eq!(distribution::f_quantile(Tail::Lower(1e-300), 1.0, 4.0), 0.0);
    assert_eq!(
        distribution::f_quantile(Tail::Upper(1e-300), 4.0, 1.0),
        f64::INFINITY
    );
}
