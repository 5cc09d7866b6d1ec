//! The edge of one piece: what its pixels see, fitted in the place of the edge.
//!
//! # Idea
//! The demodulated light of a pixel is linear in what the pixel sees: its share of the material, of
//! the wall of the sheet, and of the background. With the place e of the edge given, the complex
//! brightness of material and background follow by linear least squares, level by level; what is
//! left is one unknown, by Gauss–Newton on the projected residuals (G. Golub & V. Pereyra, SIAM J.
//! Numer. Anal. 10, 1973, with the approximation of L. Kaufman, BIT 15, 1975).
//!
//! # Equations
//! With F, M, S of [`super::edge`] at d − e, and k = 2π r times the gradient of the plane's phase
//! along d, per px:
//!
//! ```text
//! w = b (m + q W) + a n
//! m = F + i k M − k² S / 2                material
//! n = 1 − (the same at the background's border)
//! W = Σ_j [F(d + s_j+1) − F(d + s_j)] e^{2πi r z_j / h}     the wall's slices
//! ```
//!
//! M is where in a pixel the material lies, S how far it spreads: a pixel that the edge cuts has
//! its phase at the middle of its share, and averages over less of the fringe than a whole one.
//!
//! # Shapes and units
//! e and distances in px of the picture along d. w in counts.

use super::complex::Complex;
use super::edge::{Edge, Profile};
use super::piece::{Piece, Pixel};
use super::sample::Samples;
use super::view::Setup;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Share of the pixels' number that is added to a normal matrix's diagonal, so that a background
/// that is not seen has no brightness.
const RIDGE: f64 = 1e-7;
/// Largest step, px.
const STEP: f64 = 1.0;
/// A smaller step is the last, and is taken without looking again, px: what it leaves is of second
/// order.
const SMALL: f64 = 2e-3;
/// Width of a slice of the wall, px.
const SLICE: f64 = 0.5;
/// Slices of the wall: more than the band is wide are not seen.
const SLICES: f64 = 16.0;

/// How one border's share, moment and spread are, and change with e and with σ.
type Parts = [[f64; 3]; 3];

/// What one pixel sees at one place of the edge.
#[derive(Clone, Copy, Debug)]
struct Seen {
    material: Parts,
    background: Parts,
    sample: usize,
}

/// Buffers of a fit.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    seen: Vec<Seen>,
    /// Share of each slice of the wall at each pixel, and how it changes with e and with σ.
    slices: Vec<[f64; 3]>,
    /// m, n and w of one level.
    basis: Vec<[Complex; 3]>,
}

/// The fit at one place of the edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fit {
    /// e, px.
    pub edge: f64,
    /// Σ of squared residuals over their variance.
    pub cost: f64,
    /// Degrees of freedom.
    pub freedom: f64,
    /// Normal matrix of e and σ, projected: ee, eσ, σσ.
    pub matrix: [f64; 3],
    /// Its right side.
    pub right: [f64; 2],
    /// The least of the levels' brightness of the material, b's real part, counts.
    pub material: f64,
    /// The largest brightness of the background over the material's.
    pub background: f64,
    /// What the cost would be if all of the material's light were left.
    pub strength: f64,
    /// The largest angle of b, turns.
    pub off: f64,
}

impl Fit {
    /// Variance of e, px².
    pub fn variance(&self) -> f64 {
        1.0 / self.matrix[0]
    }
}

/// A piece that is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// The piece.
    pub piece: &'a Piece,
    /// Its pixels.
    pub pixels: &'a [Pixel],
    /// What they saw.
    pub samples: &'a Samples,
    /// Light and noise.
    pub setup: &'a Setup,
    /// σ of the camera's blur, px.
    pub blur: f64,
}

impl Problem<'_> {
    /// The best place within `reach` px of the contour, looked for pixel by pixel first if that is
    /// more than one; `None` if nothing determines it.
    pub fn solve(&self, reach: f64, buffers: &mut Buffers) -> Option<Fit> {
        let mut best = self.at(0.0, buffers)?;
        let mut away = 1.0;
        while away <= reach {
            for edge in [-away, away] {
                if let Some(other) = self.at(edge, buffers)
                    && other.cost < best.cost
                {
                    best = other;
                }
            }
            away += 1.0;
        }
        for _ in 0..12 {
            let step = (best.right[0] / best.matrix[0]).clamp(-STEP, STEP);
            if !step.is_finite() {
                return None;
            }
            if libm::fabs(step) < SMALL {
                best.edge += step;
                break;
            }
            let (mut next, mut step) = (self.at(best.edge + step, buffers)?, step);
            for _ in 0..3 {
                if next.cost <= best.cost {
                    break;
                }
                step /= 4.0;
                next = self.at(best.edge + step, buffers)?;
            }
            if next.cost > best.cost {
                break;
            }
            best = next;
        }
        Some(best)
    }

    /// The fit with the edge at `edge`.
    fn at(&self, edge: f64, buffers: &mut Buffers) -> Option<Fit> {
        let slices = self.look(edge, buffers);
        let levels = self.setup.levels.len();
        let count = self.pixels.len();
        let mut fit = Fit {
            edge,
            freedom: (2 * count * levels) as f64 - (4 * levels) as f64 - 1.0,
            material: f64::INFINITY,
            ..Fit::default()
        };
        for level in 0..levels {
            self.add_level(level, slices, buffers, &mut fit)?;
        }
        Some(fit)
    }

    /// Works out what each pixel sees; how many slices the wall has.
    fn look(&self, at: f64, buffers: &mut Buffers) -> usize {
        let edge = Edge::new(self.piece.normal, self.blur);
        let parts = |d: f64, follow: f64| {
            let profile = edge.at(d);
            let Profile {
                share,
                moment,
                spread,
                ..
            } = profile;
            let along = profile.along(d, &edge).map(|part| -follow * part);
            [[share, moment, spread], along, profile.widening(d, &edge)]
        };
        let (slices, width) = self.piece.wall.map_or((0, 0.0), |wall| {
            let slices = libm::ceil(wall.width / SLICE).min(SLICES);
            (slices as usize, (wall.width / slices).min(SLICE))
        });
        buffers.seen.clear();
        buffers.slices.clear();
        for pixel in self.pixels {
            let d = pixel.d - at;
            let material = parts(d, 1.0);
            let border = pixel.d + pixel.behind - pixel.follow * at;
            let background = match pixel.behind > 0.0 {
                true => parts(border, pixel.follow),
                false => material,
            };
            let mut last = material;
            for slice in 1..=slices {
                let next = parts(d + width * slice as f64, 1.0);
                buffers
                    .slices
                    .push([0, 1, 2].map(|i| next[i][0] - last[i][0]));
                last = next;
            }
            buffers.seen.push(Seen {
                material,
                background,
                sample: pixel.sample,
            });
        }
        slices
    }

    /// Adds a level's residuals and normal equations.
    fn add_level(
        &self,
        level: usize,
        slices: usize,
        buffers: &mut Buffers,
        fit: &mut Fit,
    ) -> Option<()> {
        let Buffers {
            seen,
            slices: all,
            basis,
        } = buffers;
        let fringes = &self.setup.levels[level];
        let k = TAU * fringes.ratio * self.piece.gradient;
        let light = |part: [f64; 3]| Complex::new(part[0] - k * k / 2.0 * part[2], k * part[1]);
        // The wall's light in each slice.
        let mut walls = [Complex::default(); SLICES as usize];
        if let Some(wall) = self.piece.wall {
            let share = (SLICE / wall.width).min(1.0 / slices as f64);
            for (slice, light) in walls.iter_mut().enumerate() {
                let depth = share * (slice as f64 + 0.5);
                *light = Complex::turned(fringes.ratio * wall.turns * depth) * wall.brightness;
            }
        }
        let material = |at: usize, what: usize| {
            let mut sum = light(seen[at].material[what]);
            for (slice, wall) in all[at * slices..][..slices].iter().zip(&walls) {
                sum += *wall * slice[what];
            }
            sum
        };
        let background = |at: usize, what: usize| {
            let whole = if what == 0 { 1.0 } else { 0.0 };
            Complex::new(whole, 0.0) - light(seen[at].background[what])
        };
        basis.clear();
        let mut equations = Equations::default();
        for (at, seen) in seen.iter().enumerate() {
            let (m, n) = (material(at, 0), background(at, 0));
            equations.add(m, n);
            basis.push([m, n, self.samples.light(seen.sample, level)]);
        }
        equations.lift(RIDGE * seen.len() as f64);
        let [b, a] = equations.solve(basis.iter().map(|&[m, n, w]| (m, n, w)))?;
        let mut sums = [0.0; 6];
        for (at, &[m, n, w]) in basis.iter().enumerate() {
            let rest = w - b * m - a * n;
            let [e, s] = [1, 2].map(|what| b * material(at, what) + a * background(at, what));
            let dot = |x: Complex, y: Complex| x.re * y.re + x.im * y.im;
            for (sum, term) in sums.iter_mut().zip([
                rest.square(),
                e.square(),
                dot(e, s),
                s.square(),
                dot(e, rest),
                dot(s, rest),
            ]) {
                *sum += term;
            }
        }
        // What material and background can take up of a change tells nothing of e and σ.
        let taken = |what: usize| {
            let changes = basis
                .iter()
                .enumerate()
                .map(|(at, &[m, n, _])| (m, n, b * material(at, what) + a * background(at, what)));
            equations.project(changes)
        };
        let (e, s) = (taken(1)?, taken(2)?);
        let weight = 1.0 / fringes.variance(self.setup.noise);
        fit.cost += weight * sums[0];
        fit.matrix[0] += weight * (sums[1] - e.of(&e));
        fit.matrix[1] += weight * (sums[2] - e.of(&s));
        fit.matrix[2] += weight * (sums[3] - s.of(&s));
        fit.right[0] += weight * sums[4];
        fit.right[1] += weight * sums[5];
        fit.strength += weight * b.square() * basis.len() as f64;
        fit.material = fit.material.min(b.re);
        fit.background = fit.background.max(a.length() / b.length());
        fit.off = fit.off.max(libm::fabs(b.turns()));
        Some(())
    }
}

/// Normal equations of two complex unknowns.
#[derive(Clone, Copy, Debug, Default)]
struct Equations {
    mm: f64,
    nn: f64,
    /// Σ m̄ n.
    mn: Complex,
}

/// A vector's right side in the normal equations, and the solution.
#[derive(Clone, Copy, Debug)]
struct Projection {
    right: [Complex; 2],
    solution: [Complex; 2],
}

impl Projection {
    /// The scalar product of two projected vectors.
    fn of(&self, other: &Self) -> f64 {
        let dot = |x: Complex, y: Complex| x.re * y.re + x.im * y.im;
        dot(self.right[0], other.solution[0]) + dot(self.right[1], other.solution[1])
    }
}

impl Equations {
    fn add(&mut self, m: Complex, n: Complex) {
        self.mm += m.square();
        self.nn += n.square();
        self.mn += m.conj() * n;
    }

    fn lift(&mut self, by: f64) {
        self.mm += by;
        self.nn += by;
    }

    /// The least-squares solution for a vector, given with m and n.
    fn project(&self, of: impl Iterator<Item = (Complex, Complex, Complex)>) -> Option<Projection> {
        let mut right = [Complex::default(); 2];
        for (m, n, w) in of {
            right[0] += m.conj() * w;
            right[1] += n.conj() * w;
        }
        let determinant = self.mm * self.nn - self.mn.square();
        if !(determinant > 0.0) {
            return None;
        }
        let scale = 1.0 / determinant;
        let solution = [
            (right[0] * self.nn - self.mn * right[1]) * scale,
            (right[1] * self.mm - self.mn.conj() * right[0]) * scale,
        ];
        Some(Projection { right, solution })
    }

    fn solve(&self, of: impl Iterator<Item = (Complex, Complex, Complex)>) -> Option<[Complex; 2]> {
        self.project(of).map(|found| found.solution)
    }
}
