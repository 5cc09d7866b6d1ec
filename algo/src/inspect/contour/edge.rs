//! What a square pixel sees of a straight edge, behind a lens that blurs it.
//!
//! # Idea
//! Light is blurred first and integrated over the pixel then. Across an edge, the pixel is a box as
//! wide as its side times |cos| of the edge's direction, convolved with one of |sin|: a trapezoid,
//! not a Gaussian. A normal distribution of the same variance moves edges of sharp cameras by
//! several µm; the closed form costs four normal distributions instead of one.
//!
//! # Equations
//! d is the distance of the pixel's centre from the edge, in px, positive on the material. K is the
//! density of where across the edge a pixel's light comes from: box 2a ⊗ box 2b ⊗ Gaussian σ. All
//! are second differences of integrals of the normal distribution Φ:
//!
//! ```text
//! D[f](d) = [f(d+a+b) − f(d+a−b) − f(d−a+b) + f(d−a−b)] / 4ab
//! K′ = D[Φ]     K = D[P′]     F = ∫K = D[P]     H = ∫F = D[Q]     I = ∫H = D[R]
//! P(σz) = σ² ((z² + 1) Φ + z φ) / 2     P′ = σ (z Φ + φ)     P″ = Φ
//! Q(σz) = σ³ ((z³ + 3z) Φ + (z² + 2) φ) / 6
//! R(σz) = σ⁴ ((z⁴ + 6z² + 3) Φ + (z³ + 5z) φ) / 24
//! share F     moment M = ∫₋d sK ds = H − dF     spread = ∫₋d (s² − σ_t²) K ds
//! ```
//!
//! with σ_t² = σ² + 1/12, which does not depend on the direction. The moment tells where in the
//! pixel the seen material lies on average, which fine fringes show as phase.
//!
//! # Accuracy
//! Within 3e-7 of sums over the pixel (`the_closed_form_is_the_integral_over_the_pixel`).

use core::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Half widths below this are taken as this: the second difference would cancel, and a variance of
/// less than 1e-5 px² is added.
const LEAST_HALF: f64 = 0.005;
/// Beyond so many σ from the pixel's corners nothing of the edge is seen.
const REACH: f64 = 5.5;

/// How a pixel sees edges of one direction.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Half widths of the two boxes, px.
    half: [f64; 2],
    sigma: f64,
    reach: f64,
}

/// What a pixel sees at one distance from an edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
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
        let half = [normal.0, normal.1].map(|part| (libm::fabs(part) / 2.0).max(LEAST_HALF));
        Self {
            half,
            sigma,
            reach: half[0] + half[1] + REACH * sigma,
        }
    }

    /// σ_t²: variance of where across the edge a pixel's light comes from, px².
    pub fn variance(&self) -> f64 {
        let [a, b] = self.half;
        self.sigma * self.sigma + (a * a + b * b) / 3.0
    }

    /// What a pixel at distance `d` px sees.
    pub fn at(&self, d: f64) -> Profile {
        if libm::fabs(d) >= self.reach {
            let share = if d > 0.0 { 1.0 } else { 0.0 };
            return Profile {
                share,
                ..Profile::default()
            };
        }
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
        Profile {
            share,
            moment: first - d * share,
            spread: (d * d - self.variance()) * share - 2.0 * (d * first - second),
            slope: slope * sigma * scale,
            bend: bend * scale,
        }
    }
}

impl Profile {
    /// How share, moment and spread change with d.
    pub fn along(&self, d: f64, edge: &Edge) -> [f64; 3] {
        let spread = (d * d - edge.variance()) * self.slope;
        [self.slope, -d * self.slope, spread]
    }

    /// How share and moment change with σ: ∂F/∂σ = σ F″ (heat equation). What the spread changes by
    /// is left out: it only steers the search for σ.
    pub fn widening(&self, d: f64, edge: &Edge) -> [f64; 3] {
        let moment = self.slope - d * self.bend;
        [edge.sigma * self.bend, edge.sigma * moment, 0.0]
    }
}

/// Φ, P′, P, Q and R for σ = 1.
fn integrals(z: f64) -> [f64; 5] {
    let square = z * z;
    let density = libm::exp(-0.5 * square) / libm::sqrt(TAU);
    let below = 0.5 * libm::erfc(-z * FRAC_1_SQRT_2);
    [
        below,
        z * below + density,
        ((square + 1.0) * below + z * density) / 2.0,
        (z * (square + 3.0) * below + (square + 2.0) * density) / 6.0,
        ((square * (square + 6.0) + 3.0) * below + z * (square + 5.0) * density) / 24.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by sums over a fine grid: light at s from the centre across the edge, K(s) as a
    /// density of two boxes and a Gaussian.
    fn summed(normal: (f64, f64), sigma: f64, d: f64) -> [f64; 3] {
        const GRID: usize = 1000;
        let (mut sums, mut whole) = ([0.0; 3], 0.0);
        for x in 0..GRID {
            let x = (x as f64 + 0.5) / GRID as f64 - 0.5;
            for y in 0..GRID {
                let y = (y as f64 + 0.5) / GRID as f64 - 0.5;
                let s = x * normal.0 + y * normal.1;
                let z = (d + s) / sigma;
                let [below, first, ..] = integrals(z);
                let density = first - z * below;
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
    fn the_closed_form_is_the_integral_over_the_pixel() {
        // The midpoint rule of 1000² cells: 1/24 · (1e-3)² · F″ ≤ 1e-7 for σ ≥ 0.3.
        const TOLERANCE: f64 = 3e-7;
        for angle in [0.0, 0.2, 0.785, 1.4] {
            let normal = (libm::cos(angle), libm::sin(angle));
            for (sigma, d) in [(0.3, 0.1), (0.5, -0.6), (1.0, 0.9), (2.5, -1.5)] {
                let edge = Edge::new(normal, sigma);
                let [share, moment, second] = summed(normal, sigma, d);
                let found = edge.at(d);
                let spread = second - edge.variance() * share;
                let off = [
                    found.share - share,
                    found.moment - moment,
                    found.spread - spread,
                ];
                // The least half width adds 8e-6 px² where an edge lies along the pixels.
                let margin = if angle == 0.0 { 1e-5 } else { TOLERANCE };
                assert!(off.iter().all(|off| off.abs() < margin), "{angle} {off:?}");
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_profile() {
        const STEP: f64 = 1e-4;
        let normal = (0.6, 0.8);
        for (sigma, d) in [(0.3, 0.2), (0.6, -0.8), (1.5, 1.3)] {
            let edge = Edge::new(normal, sigma);
            let at = edge.at(d);
            let parts = |p: Profile| [p.share, p.moment, p.spread];
            let rate = |one: Profile, other: Profile| {
                let (one, other) = (parts(one), parts(other));
                [0, 1, 2].map(|i| (one[i] - other[i]) / (2.0 * STEP))
            };
            let along = rate(edge.at(d + STEP), edge.at(d - STEP));
            let wider = Edge::new(normal, sigma + STEP).at(d);
            let widening = rate(wider, Edge::new(normal, sigma - STEP).at(d));
            for (found, is) in at.along(d, &edge).iter().zip(along) {
                assert!((found - is).abs() < 1e-6);
            }
            // The spread's is left out.
            for (found, is) in at.widening(d, &edge).iter().zip(widening).take(2) {
                assert!((found - is).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn far_from_the_edge_all_or_nothing_is_seen() {
        let edge = Edge::new((0.6, 0.8), 0.5);
        for d in [3.4, 3.5] {
            let (near, far) = (edge.at(d), edge.at(-d));
            assert!((near.share - 1.0).abs() < 1e-7 && far.share.abs() < 1e-7);
            assert!(near.moment.abs() < 1e-6 && near.spread.abs() < 1e-6);
        }
    }
}
