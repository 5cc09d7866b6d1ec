//! Figures of the manual of the AIAG, of NIST and of textbooks.

use super::{close, measured};
use crate::study::process::Course;
use crate::study::{CapabilityLimits, Decimal, GaugeCapability, Repeatability, StudyLimits, marks};
use std::fmt::Write as _;

/// AIAG, *Measurement Systems Analysis*, 4th edition, 2010: three trials of A, then B, then C, of each part.
const MANUAL: &str = "
    .29 .41 .64 .08 .25 .07 .04 -.11 -.15
    -.56 -.68 -.58 -.47 -1.22 -.68 -1.38 -1.13 -.96
    1.34 1.17 1.27 1.19 .94 1.34 .88 1.09 .67
    .47 .50 .64 .01 1.03 .20 .14 .20 .11
    -.80 -.92 -.84 -.56 -1.20 -1.28 -1.46 -1.07 -1.45
    .02 -.11 -.21 -.20 .22 .06 -.29 -.67 -.49
    .59 .75 .66 .47 .55 .83 .02 .01 .21
    -.31 -.20 -.17 -.63 .08 -.34 -.46 -.56 -.49
    2.26 1.99 2.01 1.80 2.12 2.19 1.77 1.45 1.87
    -1.36 -1.25 -1.31 -1.68 -1.62 -1.50 -1.49 -1.77 -2.16";

/// The manual's values, as a spreadsheet with decimal commas has them.
fn manual() -> String {
    let mut csv = "value;trial;operator;part\n".to_owned();
    for (part, line) in MANUAL.trim().lines().enumerate() {
        for (at, value) in line.split_whitespace().enumerate() {
            let appraiser = ["A", "B", "C"][at / 3];
            let _ = writeln!(
                csv,
                "{};{};{appraiser};{part}",
                value.replace('.', ","),
                at % 3
            );
        }
    }
    csv
}

fn sigma(study: &Repeatability, name: &str) -> f64 {
    study
        .components
        .iter()
        .find(|component| component.name == name)
        .unwrap()
        .sigma
}

#[test]
fn the_manuals_example_has_the_manuals_figures() {
    let study = Repeatability::of(&measured(&manual()), &StudyLimits::USUAL).unwrap();
    let squares: Vec<f64> = study.anova.iter().map(|row| row.ss).collect();
    for (found, published) in squares
        .iter()
        .zip([88.36193444, 3.16726222, 0.35898222, 2.75893333])
    {
        close(*found, published, 1e-8);
    }
    let interaction = &study.anova[2];
    close(interaction.f.unwrap(), 0.43372103, 1e-7);
    close(interaction.p.unwrap(), 0.97410640, 1e-7);
    assert!(study.pooled);
    for (name, published) in [
        ("EV", 0.19993318),
        ("AV", 0.22683752),
        ("GRR", 0.30237152),
        ("PV", 1.04232749),
        ("TV", 1.08529956),
    ] {
        close(sigma(&study, name), published, 1e-7);
    }
    let shares = study
        .components
        .iter()
        .filter(|component| ["EV", "AV", "GRR", "PV"].contains(&component.name));
    let shares: Vec<String> = shares
        .map(|component| format!("{:.2}", component.of_study.unwrap()))
        .collect();
    assert_eq!(shares, ["18.42", "20.90", "27.86", "96.04"]);
    assert_eq!(study.ndc, Some(4.0));
    close(study.ndc_unrounded.unwrap(), 4.8605, 1e-5);
    let kept = StudyLimits {
        pool: 1.0,
        ..StudyLimits::USUAL
    };
    close(
        sigma(
            &Repeatability::of(&measured(&manual()), &kept).unwrap(),
            "EV",
        ),
        0.214435,
        1e-5,
    );
}

/// Levels of treatments and replicates of NIST's SmLs01 to 09.
fn level(number: usize) -> u8 {
    match number {
        1 => 2,
        even if even.is_multiple_of(2) => 1,
        _ => 3,
    }
}

/// Fails unless a one-way table has this F and these mean squares.
#[track_caller]
fn one_way(parts: &[Vec<String>], f: f64, between: f64, within: f64) {
    let mut csv = "part,value\n".to_owned();
    for (part, values) in parts.iter().enumerate() {
        values.iter().for_each(|value| {
            let _ = writeln!(csv, "{part},{value}");
        });
    }
    let study = Repeatability::of(&measured(&csv), &StudyLimits::USUAL).unwrap();
    assert_eq!(study.design, "one-way");
    close(study.anova[0].f.unwrap(), f, 1e-12);
    close(study.anova[0].ms.unwrap(), between, 1e-12);
    close(study.anova[1].ms.unwrap(), within, 1e-12);
}

#[test]
fn nists_one_way_sets_have_twelve_digits() {
    for base in ["1", "1000000", "1000000000000"] {
        for replicates in [21, 201, 2001] {
            let part = |treatment| {
                (1..=replicates)
                    .map(|replicate| format!("{base}.{}", level(treatment) + level(replicate)))
                    .collect()
            };
            let parts: Vec<Vec<String>> = (1..=9).map(part).collect();
            let r = replicates as f64;
            one_way(&parts, r, r / 100.0, 0.01);
        }
    }
    let set = |text: &str| {
        text.lines()
            .map(|line| line.split_whitespace().map(str::to_owned).collect())
            .collect::<Vec<_>>()
    };
    // SiRstv: resistivity of silicon by five instruments.
    let instruments = set("196.3052 196.1240 196.1890 196.2569 196.3403\n196.3042 196.3825 196.1669 196.3257 196.0422
        196.1303 196.2005 196.2889 196.0343 196.1811\n196.2795 196.1748 196.1494 196.1485 195.9885\n196.2119 196.1051 196.1850 196.0052 196.2090");
    one_way(&instruments, 1.18046237440255, 1.27865654e-2, 1.0831828e-2);
    // AtmWtAg: atomic weight of silver.
    let weights = set("107.8681568 107.8681465 107.8681572 107.8681785 107.8681446 107.8681903 107.8681526 107.8681494 107.8681616 107.8681587 107.8681519 107.8681486 107.8681419 107.8681569 107.8681508 107.8681672 107.8681385 107.8681518 107.8681662 107.8681424 107.8681360 107.8681333 107.8681610 107.8681477
        107.8681079 107.8681344 107.8681513 107.8681197 107.8681604 107.8681385 107.8681642 107.8681365 107.8681151 107.8681082 107.8681517 107.8681448 107.8681198 107.8681482 107.8681334 107.8681609 107.8681101 107.8681512 107.8681469 107.8681360 107.8681254 107.8681261 107.8681450 107.8681368");
    one_way(
        &weights,
        15.9467335677930,
        3.638341875e-9,
        2.28155932971014e-10,
    );
}

#[test]
fn a_capability_follows_its_formulas() {
    // 0.01 and -0.01 about 10.002: s² = 6e-4/5.
    let values = measured("value\n10.012\n9.992\n10.012\n9.992\n10.012\n9.992\n");
    let limits = CapabilityLimits {
        resolution: 0.001,
        u_reference: 0.002,
        u_others: vec![0.003],
        ..CapabilityLimits::USUAL
    };
    let reference = Decimal::read("10.000").unwrap();
    let study = GaugeCapability::of(&values, reference, 0.6, &limits).unwrap();
    let s = (6e-4_f64 / 5.0).sqrt();
    close(study.s.unwrap(), s, 1e-12);
    close(study.bias, 0.002, 1e-12);
    close(study.cg.unwrap(), 0.2 * 0.6 / (6.0 * s), 1e-12);
    close(study.cgk.unwrap(), (0.1 * 0.6 - 0.002) / (3.0 * s), 1e-12);
    let u = 2.0 * (0.002_f64.powi(2) + s * s + 0.002_f64.powi(2) / 3.0 + 0.003_f64.powi(2)).sqrt();
    close(study.u_ms.unwrap(), u, 1e-12);
    close(study.q_ms.unwrap(), 200.0 * u / 0.6, 1e-12);
    // t of 5 degrees of freedom beyond which lie 2.5 %.
    close(
        study.bias_interval.unwrap()[1],
        0.002 + 2.570581835636 * s / 6_f64.sqrt(),
        1e-11,
    );
    assert!(
        study
            .to_string()
            .ends_with("fit: C_g 1.8257 ≥ 1.33; C_gk 1.7649 ≥ 1.33; Q_MS 7.7268 % ≤ 15 %\n"),
        "{study}"
    );
}

#[test]
fn the_viscosity_of_a_primer_is_in_control() {
    // Montgomery, Introduction to Statistical Quality Control, 6th edition, table 6.6.
    let values = measured(
        "value\n33.75\n33.05\n34.00\n33.81\n33.46\n34.02\n33.68\n33.27\n33.49\n33.20\n33.62\n33.00\n33.54\n33.12\n33.84\n",
    );
    let bounds = (Decimal::read("32"), Decimal::read("35"));
    let process = Course::of(&values, bounds).figures(&marks::USUAL);
    let [group] = &process.groups[..] else {
        panic!("limits did not change")
    };
    close(group.mean, 33.5233333333, 1e-10);
    close(group.mean_range.unwrap(), 0.4807142857, 1e-9);
    let sigma = 0.480_714_285_714_285_7 / 1.128;
    let [low, high] = group.control.unwrap();
    close(low, 33.523_333_333_333_33 - 3.0 * sigma, 1e-12);
    close(high, 33.523_333_333_333_33 + 3.0 * sigma, 1e-12);
    close(
        group.largest_range.unwrap(),
        3.267 * 0.480_714_285_714_285_7,
        1e-12,
    );
    assert!(group.marks.as_ref().unwrap().is_empty());
    let cp = group.cp.unwrap();
    close(cp.value, 3.0 / (6.0 * sigma), 1e-12);
    // χ² of 14 degrees of freedom: 5.6287 and 26.1189.
    close(cp.from, cp.value * (5.628726103 / 14.0_f64).sqrt(), 1e-9);
    close(cp.to, cp.value * (26.118948045 / 14.0_f64).sqrt(), 1e-9);
    let cpk = group.cpk.unwrap();
    close(
        cpk.value,
        (35.0 - 33.523_333_333_333_33) / (3.0 * sigma),
        1e-12,
    );
    close(
        cpk.value - cpk.from,
        1.96 * (1.0 / 135.0 + cpk.value * cpk.value / 28.0).sqrt(),
        1e-12,
    );
}

/// Where a test marks values that are given in σ, from 1 on.
fn marked(test: u8, values: &[f64]) -> Vec<usize> {
    marks::of(values, &[test])
        .iter()
        .map(|(at, _)| at + 1)
        .collect()
}

#[test]
fn marks_are_where_a_test_is_completed() {
    assert_eq!(marked(1, &[0.0, 3.1, -3.1, 3.0]), [2, 3]);
    assert_eq!(
        marked(2, &[[0.1; 10].as_slice(), &[0.0], &[-0.1; 9]].concat()),
        [9, 10, 20]
    );
    assert_eq!(marked(3, &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6]), [7]);
    let alternate: Vec<f64> = (0..16).map(|at| f64::from(at % 2)).collect();
    assert_eq!(marked(4, &alternate), [15, 16]);
    assert_eq!(marked(5, &[0.0, 2.1, 0.0, 2.1, -2.1, 0.0, 0.0, -2.1]), [4]);
    assert_eq!(marked(6, &[1.1, 1.1, 0.0, 1.1, 1.1, -1.1]), [5]);
    assert_eq!(marked(7, &[0.5; 15]), [15]);
    assert_eq!(
        marked(8, &[1.1, -1.1, 1.1, -1.1, 1.1, -1.1, 1.1, -1.1]),
        [8]
    );
    assert_eq!(marks::of(&[4.0; 9], &marks::USUAL).last(), Some(&(8, 2)));
}

#[test]
fn where_limits_change_a_new_group_begins() {
    let csv = "characteristic,value,low,high\na [mm],1,0,2\na [mm],1.5,0,2\na [mm],1,0,3\na [mm],2,0,3\na [mm],1,0,2\n";
    let process = Course::of(&measured(csv), (None, None)).figures(&marks::USUAL);
    assert_eq!(
        (process.characteristic.as_str(), process.unit.as_str()),
        ("a", "mm")
    );
    let groups: Vec<_> = process
        .groups
        .iter()
        .map(|group| (group.first, group.n, group.high))
        .collect();
    assert_eq!(
        groups,
        [(2, 2, Some(2.0)), (4, 2, Some(3.0)), (6, 1, Some(2.0))]
    );
    let one = Course::of(&measured(csv), (None, Decimal::read("4"))).figures(&marks::USUAL);
    assert_eq!(
        (one.groups.len(), one.groups[0].n, one.groups[0].cp),
        (1, 5, None)
    );
    assert!(one.groups[0].cpk.is_some());
}
