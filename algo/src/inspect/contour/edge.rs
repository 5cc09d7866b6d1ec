//! What a square pixel sees of a straight edge, behind a lens that blurs it.
//!
//! # Idea
//! Light is blurred first and integrated over the pixel then. Across an edge, the pixel is a box as
//! wide as its side times |cos| of the edge's direction, convolved with one of |sin|: a trapezoid,
//! not a Gaussian. A normal distribution of the same variance moves edges of sharp cameras by
//! several µm. Edgeworth's series with the cumulants of both boxes does not, and costs one normal
//! distribution. Of sharper cameras the series does not converge; their closed form costs four.
//!
//! # Equations
//! d is the distance of the pixel's centre from the edge, in px, positive on the material. K is the
//! density of where across the edge a pixel's light comes from: box 2a ⊗ box 2b ⊗ Gaussian σ, of
//! variance σ_t² = σ² + 1/12 in every direction. With z = d/σ_t, the normal density φ and
//! distribution Φ, Hermite's polynomials He and cumulants κ (H. Cramér, Mathematical Methods of
//! Statistics, 1946, 17.7):
//!
//! ```text
//! κ_4 = −2 (a⁴ + b⁴)/15   κ_6 = 16 (a⁶ + b⁶)/63   κ_8 = −16 (a⁸ + b⁸)/15     over σ_tⁿ
//! c_4 = κ_4/24   c_6 = κ_6/720   c_8 = κ_8/40320 + κ_4²/1152
//! σ_t K = φ (1 + Σ c_n He_n)     F = ∫K = Φ − φ Σ c_n He_n−1     σ_t² K′ = −φ (z + Σ c_n He_n+1)
//! share F     moment M = ∫₋d sK ds     spread S = ∫₋d (s² − σ_t²) K ds
//! M = σ_t φ [1 + Σ c_n (He_n−2 + z He_n−1)]
//! S = −σ_t² φ [z + Σ c_n ((z² − 1) He_n−1 + 2z He_n−2 + 2 He_n−3)]
//! ```
//!
//! The closed form has second differences of integrals of the normal distribution Φ:
//!
//! ```text
//! D[f](d) = [f(d+a+b) − f(d+a−b) − f(d−a+b) + f(d−a−b)] / 4ab
//! K′ = D[Φ]     K = D[P′]     F = D[P]     H = ∫F = D[Q]     I = ∫H = D[R]
//! P(σz) = σ² ((z² + 1) Φ + z φ) / 2     P′ = σ (z Φ + φ)
//! Q(σz) = σ³ ((z³ + 3z) Φ + (z² + 2) φ) / 6
//! R(σz) = σ⁴ ((z⁴ + 6z² + 3) Φ + (z³ + 5z) φ) / 24
//! M = H − d F     S = (d² − σ_t²) F − 2 (d H − I)
//! ```
//!
//! The moment tells where in the pixel the seen material lies on average, which fine fringes show
//! as phase.
//!
//! # Accuracy
//! F within 2e-4 of sums over the pixel, 2e-5 from σ = 0.5 px on, odd in d: straight edges do not
//! move (`the_profile_is_the_integral_over_the_pixel`).

use core::f64::consts::{LOG2_E, TAU};

/// Below this blur the closed form is used, px.
const SHARP: f64 = 0.35;
/// Half widths below this are taken as this in the closed form: the second difference would cancel,
/// and a variance of less than 1e-5 px² is added.
const LEAST_HALF: f64 = 0.005;

/// Beyond so many σ_t from the edge nothing of it is seen: 4e-6 of the light.
const REACH: f64 = 4.5;

/// Beyond so many σ 2e-11 of a normal distribution are left.
const OVER: f64 = 6.7;

/// Coefficients of z^0, z^2, … in brackets above, times those of 1, c_4, c_6 and c_8.
type Series = [[f64; 5]; 4];
const SHARE: Series = [
    [0.0; 5],
    [-3.0, 1.0, 0.0, 0.0, 0.0],
    [15.0, -10.0, 1.0, 0.0, 0.0],
    [-105.0, 105.0, -21.0, 1.0, 0.0],
];
const SLOPE: Series = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [3.0, -6.0, 1.0, 0.0, 0.0],
    [-15.0, 45.0, -15.0, 1.0, 0.0],
    [105.0, -420.0, 210.0, -28.0, 1.0],
];
const BEND: Series = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [15.0, -10.0, 1.0, 0.0, 0.0],
    [-105.0, 105.0, -21.0, 1.0, 0.0],
    [945.0, -1260.0, 378.0, -36.0, 1.0],
];
const MOMENT: Series = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [-1.0, -2.0, 1.0, 0.0, 0.0],
    [3.0, 9.0, -9.0, 1.0, 0.0],
    [-15.0, -60.0, 90.0, -20.0, 1.0],
];
const SPREAD: Series = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [3.0, -2.0, 1.0, 0.0, 0.0],
    [-15.0, 15.0, -9.0, 1.0, 0.0],
    [105.0, -140.0, 98.0, -20.0, 1.0],
];

/// How a pixel sees edges of one direction.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    sigma: f64,
    /// a and b, px.
    half: [f64; 2],
    /// σ_t, px.
    whole: f64,
    /// The brackets of share, slope, bend, moment and spread as polynomials of z².
    series: [[f64; 5]; 5],
}

/// What a pixel sees at one distance from an edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EdgeProfile {
    /// F: which share of its light comes from the material.
    pub share: f64,
    /// M: the share times how far beyond the centre, along d, it comes from on average, px.
    pub moment: f64,
    /// The share times the mean square of that, less what a whole pixel has of it, px².
    pub spread: f64,
    /// F′ = K, per px.
    pub slope: f64,
    /// F″, per px².
    pub bend: f64,
}

impl Edge {
    /// Edges whose normal has these components along the pixel's sides, under blur of `sigma` px.
    pub fn new(normal: (f64, f64), sigma: f64) -> Self {
        let square = sigma * sigma + 1.0 / 12.0;
        // (a/σ_t)² and (b/σ_t)²; powers of them.
        let [a, b] = [normal.0, normal.1].map(|part| part * part / 4.0 / square);
        let (a2, b2) = (a * a, b * b);
        let fourth = -2.0 / 15.0 * (a2 + b2);
        let sixth = 16.0 / 63.0 * (a2 * a + b2 * b);
        let eighth = -16.0 / 15.0 * (a2 * a2 + b2 * b2);
        let weights = [
            1.0,
            fourth / 24.0,
            sixth / 720.0,
            eighth / 40_320.0 + fourth * fourth / 1_152.0,
        ];
        let series = [SHARE, SLOPE, BEND, MOMENT, SPREAD].map(|of| {
            let mut sums = [0.0; 5];
            for (weight, series) in weights.iter().zip(of) {
                for (sum, part) in sums.iter_mut().zip(series) {
                    *sum += weight * part;
                }
            }
            sums
        });
        Self {
            sigma,
            half: [normal.0, normal.1].map(|part| (libm::fabs(part) / 2.0).max(LEAST_HALF)),
            whole: libm::sqrt(square),
            series,
        }
    }

    /// σ_t²: variance of where across the edge a pixel's light comes from, px².
    pub fn variance(&self) -> f64 {
        self.whole * self.whole
    }

    /// How far from an edge pixels see one side only, px.
    pub fn reach(&self) -> f64 {
        REACH * self.whole
    }

    /// What a pixel at distance `d` px sees.
    pub fn at(&self, d: f64) -> EdgeProfile {
        if libm::fabs(d) >= self.reach() {
            let share = if d > 0.0 { 1.0 } else { 0.0 };
            return EdgeProfile {
                share,
                ..EdgeProfile::default()
            };
        }
        if self.sigma < SHARP {
            return self.sharp(d);
        }
        let z = d / self.whole;
        let y = z * z;
        let density = density(y);
        let [share, slope, bend, moment, spread] = self
            .series
            .map(|[a, b, c, d, e]| density * (a + y * (b + y * (c + y * (d + y * e)))));
        EdgeProfile {
            share: below(z, density) - z * share,
            moment: self.whole * moment,
            spread: -self.whole * self.whole * z * spread,
            slope: slope / self.whole,
            bend: -z * bend / (self.whole * self.whole),
        }
    }

    /// The same by the closed form.
    fn sharp(&self, d: f64) -> EdgeProfile {
        let ([a, b], sigma) = (self.half, self.sigma);
        let mut sums = [0.0; 5];
        for (at, sign) in [
            (d + a + b, 1.0),
            (d + a - b, -1.0),
            (d - a + b, -1.0),
            (d - a - b, 1.0),
        ] {
            for (sum, term) in sums.iter_mut().zip(integrals(at / sigma)) {
                *sum += sign * term;
            }
        }
        let [bend, slope, share, first, second] = sums;
        let scale = 1.0 / (4.0 * a * b);
        let square = sigma * sigma;
        let share = share * square * scale;
        let first = first * square * sigma * scale;
        let second = second * square * square * scale;
        EdgeProfile {
            share,
            moment: first - d * share,
            spread: (d * d - self.variance()) * share - 2.0 * (d * first - second),
            slope: slope * sigma * scale,
            bend: bend * scale,
        }
    }
}

/// Φ, P′, P, Q and R for σ = 1.
fn integrals(z: f64) -> [f64; 5] {
    let square = z * z;
    if square >= OVER * OVER {
        // All of the light, or none.
        let [share, first, second] = [
            (square + 1.0) / 2.0,
            z * (square + 3.0) / 6.0,
            (square * (square + 6.0) + 3.0) / 24.0,
        ];
        return match z > 0.0 {
            true => [1.0, z, share, first, second],
            false => [0.0; 5],
        };
    }
    let density = density(square);
    let below = below(z, density);
    [
        below,
        z * below + density,
        ((square + 1.0) * below + z * density) / 2.0,
        (z * (square + 3.0) * below + (square + 2.0) * density) / 6.0,
        ((square * (square + 6.0) + 3.0) * below + z * (square + 5.0) * density) / 24.0,
    ]
}

impl EdgeProfile {
    /// Share, moment and spread.
    pub fn parts(&self) -> [f64; 3] {
        [self.share, self.moment, self.spread]
    }

    /// How share, moment and spread change with d.
    pub fn along(&self, d: f64, edge: &Edge) -> [f64; 3] {
        let spread = (d * d - edge.variance()) * self.slope;
        [self.slope, -d * self.slope, spread]
    }

    /// How the share changes with σ: ∂F/∂σ = σ F″ (heat equation). What moment and spread change by
    /// is left out: it only steers the search for σ.
    pub fn widening(&self, edge: &Edge) -> f64 {
        edge.sigma * self.bend
    }
}

/// φ(z) of z² ≤ 45, within 1e-8: 2^n times Taylor's series of what is left.
fn density(square: f64) -> f64 {
    let x = -0.5 * square;
    // Casts keep to the range of their type, and cut off: this rounds, as x is not positive.
    let whole = (x * LOG2_E - 0.5) as i64;
    let x = x - whole as f64 / LOG2_E;
    let tail = 1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0 + x / 5_040.0));
    let power = 1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * tail)));
    let scale = f64::from_bits(((1023 + whole) as u64) << 52);
    power * scale / libm::sqrt(TAU)
}

/// Φ(z), from φ(z), within 8e-8 (C. Hastings; M. Abramowitz & I. A. Stegun, Handbook of
/// Mathematical Functions, 26.2.17).
fn below(z: f64, density: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * libm::fabs(z));
    let tail = -0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429));
    let above = density * t * (0.319_381_530 + t * tail);
    if z < 0.0 { above } else { 1.0 - above }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_1_SQRT_2;

    /// The same by sums over a fine grid: light at s from the centre across the edge, K(s) as a
    /// density of two boxes and a Gaussian.
    fn summed(normal: (f64, f64), sigma: f64, d: f64) -> [f64; 3] {
        const GRID: usize = 150;
        let (mut sums, mut whole) = ([0.0; 3], 0.0);
        for x in 0..GRID {
            let x = (x as f64 + 0.5) / GRID as f64 - 0.5;
            for y in 0..GRID {
                let y = (y as f64 + 0.5) / GRID as f64 - 0.5;
                let s = x * normal.0 + y * normal.1;
                let z = (d + s) / sigma;
                let density = libm::exp(-0.5 * z * z) / libm::sqrt(TAU);
                let below = 0.5 * libm::erfc(-z * FRAC_1_SQRT_2);
                // ∫ over the Gaussian t: 1, s + t, (s + t)² where d + s + t > 0.
                sums[0] += below;
                sums[1] += s * below + sigma * density;
                sums[2] += s * s * below
                    + 2.0 * s * sigma * density
                    + sigma * sigma * (below - z * density);
                whole += 1.0;
            }
        }
        sums.map(|sum| sum / whole)
    }

    #[test]
    fn the_profile_is_the_integral_over_the_pixel() {
        for angle in [0.0, 0.2, 0.785, 1.4] {
            let normal = (libm::cos(angle), libm::sin(angle));
            for (sigma, tolerance) in [
                (0.05, 2e-4),
                (0.2, 2e-5),
                (0.4, 2e-4),
                (0.5, 2e-5),
                (1.0, 5e-6),
                (2.5, 5e-6),
            ] {
                for d in [-1.5, -0.6, 0.1, 0.9] {
                    let edge = Edge::new(normal, sigma);
                    let [share, moment, second] = summed(normal, sigma, d);
                    let found = edge.at(d);
                    let spread = second - edge.variance() * share;
                    let off = [
                        found.share - share,
                        found.moment - moment,
                        found.spread - spread,
                    ];
                    let most = off.iter().fold(0.0, |most: f64, off| most.max(off.abs()));
                    assert!(most < tolerance, "{angle} {sigma} {d} {off:?}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_profile() {
        // The step's error is of second order, and that of Φ is divided by the step.
        const STEP: f64 = 5e-3;
        const TOLERANCE: f64 = 2e-4;
        let normal = (0.6, 0.8);
        for (sigma, d) in [(0.3, 0.2), (0.6, -0.8), (1.5, 1.3)] {
            let edge = Edge::new(normal, sigma);
            let at = edge.at(d);
            let parts = |p: EdgeProfile| [p.share, p.moment, p.spread];
            let rate = |one: EdgeProfile, other: EdgeProfile| {
                let (one, other) = (parts(one), parts(other));
                [0, 1, 2].map(|i| (one[i] - other[i]) / (2.0 * STEP))
            };
            let along = rate(edge.at(d + STEP), edge.at(d - STEP));
            let wider = Edge::new(normal, sigma + STEP).at(d);
            let widening = rate(wider, Edge::new(normal, sigma - STEP).at(d));
            for (found, is) in at.along(d, &edge).iter().zip(along) {
                assert!((found - is).abs() < TOLERANCE);
            }
            // Those of moment and spread are left out, and the heat equation holds for the whole
            // series only.
            assert!((at.widening(&edge) - widening[0]).abs() < 5e-3);
        }
    }

    #[test]
    fn far_from_the_edge_all_or_nothing_is_seen() {
        let edge = Edge::new((0.6, 0.8), 0.5);
        for d in [3.4, 3.5] {
            let (near, far) = (edge.at(d), edge.at(-d));
            assert!((near.share - 1.0).abs() < 1e-7 && far.share.abs() < 1e-7);
            assert!(near.moment.abs() < 1e-6 && near.spread.abs() < 1e-6);
            // Where the profile is cut off it is as good as over.
            let end = edge.at(edge.reach() - 1e-9);
            assert!(
                (end.share - 1.0).abs() < 1e-5 && end.moment.abs() < 5e-5,
                "{end:?}"
            );
        }
    }
}
