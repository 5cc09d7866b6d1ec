//! The edge of one piece: what its pixels see, fitted in the place of the edge.
//!
//! # Idea
//! The demodulated light of a pixel is linear in what the pixel sees: its share of the material, of
//! the wall of the sheet, and of the background. With the place e of the edge given, the complex
//! brightness of material and background follow by linear least squares; what is left is one
//! unknown, by Gauss–Newton on the projected residuals (G. Golub & V. Pereyra, SIAM J. Numer. Anal.
//! 10, 1973, with the approximation of L. Kaufman, BIT 15, 1975). Pixels that see one side only
//! enter as sums.
//!
//! # Equations
//! With F, M, S of [`super::edge`] at d − e, and k = 2π r times the gradient of the plane's phase
//! along d, per px:
//!
//! ```text
//! w = b (m + q W) + a n
//! m = G_k(d) = F + i k M − k² S / 2       material
//! n = 1 − (the same at the nearest border of the background, or at two that face each other)
//! W = ⟨e^{−iκd − (κ² − 2kκ) σ_t²/2} [G_k−κ(d + width) − G_k−κ(d)]⟩     wall, κ: its phase per px
//! ```
//!
//! M is where in a pixel the material lies, S how far it spreads: a pixel that the edge cuts has
//! its phase at the middle of its share, and averages over less of the fringe than a whole one. The
//! levels of a floor differ in phase, so that what changes its phase, i k M and its own gradient
//! beyond the plane's, has ⟨r a⟩ for r a, which pixels beyond the edge show; by its gradient this
//! light turns by ⟨r³⟩/⟨r²⟩. Of a wall a whole pixel averages over another phase than of the face,
//! which is the real exponent. ⟨⟩ is the mean over levels; elsewhere the levels' mean of r stands
//! for it.
//!
//! # Shapes and units
//! e and distances in px of the picture along d. w in counts.

use super::beyond::Wall;
use super::edge::{Edge, EdgeProfile};
use super::light::{Fringes, PlaneView, Signals};
use super::piece::{BAND, Piece, Pixel};
use crate::math::complex::Complex;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Share of the pixels' number that is added to a normal matrix's diagonal, so that a background
/// that is not seen has no brightness.
const RIDGE: f64 = 1e-9;
/// Largest step, px.
const STEP: f64 = 1.0;
/// A smaller step is the last, and is taken without looking again, px: what it leaves is of second
/// order.
const SMALL: f64 = 0.03;

/// Largest χ² per degree of freedom.
pub const CHI_SQUARE: f64 = 3.0;
/// What light may be off the model, of the material's, until other places are looked at.
const ODD: f64 = 0.05;

/// What one pixel sees at one place of the edge, and how that changes with e and with σ: each of
/// material and of background.
#[derive(Clone, Copy, Debug)]
pub struct SeenPixel {
    whole: [Complex; 2],
    along: [Complex; 2],
    wider: [f64; 2],
    light: Complex,
}

/// The fit at one place of the edge.
#[derive(Clone, Copy, Debug, Default)]
pub struct EdgeFit {
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
    /// The brightness of the material, b's real part, counts.
    pub material: f64,
    /// The brightness of the background over the material's.
    pub background: f64,
    /// What the cost would be if all of the material's light were left.
    pub strength: f64,
    /// The angle of b, turns.
    pub off: f64,
}

impl EdgeFit {
    /// Variance of e, px².
    pub fn variance(&self) -> f64 {
        1.0 / self.matrix[0]
    }
}

/// A piece that is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a, V> {
    /// The piece.
    pub piece: &'a Piece,
    /// Its pixels.
    pub pixels: &'a [Pixel],
    /// Light and noise.
    pub signals: &'a Signals<'a, V>,
    /// What its pixels see.
    pub edge: Edge,
    /// What blur leaves of the wall's light, in each level; empty without a wall.
    pub damped: &'a [f64],
}

/// What blur leaves of the light of a piece's wall, in each level.
pub fn damp(piece: &Piece, edge: &Edge, levels: &[Fringes], damped: &mut Vec<f64>) {
    damped.clear();
    let Some(wall) = &piece.wall else { return };
    let per_px = TAU * wall.turns / wall.width;
    let damping = per_px * (TAU * 2.0 * piece.gradient - per_px) / 2.0 * edge.variance();
    let levels = levels.iter();
    damped.extend(levels.map(|level| libm::exp(level.ratio * level.ratio * damping)));
}

impl<V: PlaneView> Problem<'_, V> {
    /// The best place of the edge; `None` if nothing determines it.
    pub fn solve(&self, seen: &mut Vec<SeenPixel>) -> Option<EdgeFit> {
        let mut best = self.at(0.0, seen)?;
        // A narrow shadow is deeper than the edge beside it, so that the least squares are several.
        if best.cost > CHI_SQUARE * (best.freedom + ODD * ODD * best.strength) {
            for edge in [-1.0, 1.0] {
                if let Some(other) = self.at(edge, seen)
                    && other.cost < best.cost
                {
                    best = other;
                }
            }
        }
        for _ in 0..12 {
            let step = (best.right[0] / best.matrix[0]).clamp(-STEP, STEP);
            if !step.is_finite() {
                return None;
            }
            if libm::fabs(step) < SMALL {
                best.edge += step;
                best.cost -= step * step * best.matrix[0];
                break;
            }
            let (mut next, mut step) = (self.at(best.edge + step, seen)?, step);
            for _ in 0..3 {
                if next.cost <= best.cost {
                    break;
                }
                step /= 4.0;
                next = self.at(best.edge + step, seen)?;
            }
            if next.cost > best.cost {
                break;
            }
            best = next;
        }
        Some(best)
    }

    /// What the cost would be if the material went on over all pixels.
    pub fn face_cost(&self) -> f64 {
        let (mut sum, mut power, mut count) = (Complex::default(), 0.0, 0.0);
        for pixel in self.pixels.iter().filter(|of| libm::fabs(of.d) <= BAND) {
            sum += pixel.light;
            power += pixel.light.square();
            count += 1.0;
        }
        (power - sum.square() / count) / self.signals.variance
    }

    /// The fit with the edge at `edge`.
    fn at(&self, edge: f64, buffer: &mut Vec<SeenPixel>) -> Option<EdgeFit> {
        buffer.clear();
        let reach = self.edge.reach();
        let wall = self.piece.wall.map_or(0.0, |wall| wall.width);
        let (mut equations, mut power, mut count) = (BrightnessEquations::default(), 0.0, 0.0);
        let rated = self.rated(edge);
        for pixel in self.pixels {
            if libm::fabs(pixel.d) > BAND {
                continue;
            }
            count += 1.0;
            let d = pixel.d - edge;
            let border = pixel.border - pixel.follow.max(0.0) * edge;
            power += if d >= reach {
                equations.mm += 1.0;
                equations.right[0] += pixel.light;
                pixel.light.square()
            } else if border.max(d + wall) <= -reach {
                let light = pixel.light + self.shifted(pixel, Complex::default(), rated);
                equations.nn += 1.0;
                equations.right[1] += light;
                light.square()
            } else {
                let seen = self.seen(pixel, d, border, rated);
                equations.add(&seen);
                buffer.push(seen);
                seen.light.square()
            };
        }
        equations.lift(RIDGE * count);
        let scale = equations.scale()?;
        let [b, a] = equations.solve(equations.right, scale);
        let rest = power - b.dot(equations.right[0]) - a.dot(equations.right[1]);
        // What material and background can take up of a change tells nothing of e and σ.
        let (mut sums, mut taken) = ([0.0; 5], [[Complex::default(); 2]; 2]);
        for seen in buffer.iter() {
            let [m, n] = seen.whole;
            let rest = seen.light - b * m - a * n;
            let e = b * seen.along[0] + a * seen.along[1];
            let s = b * seen.wider[0] + a * seen.wider[1];
            let terms = [e.square(), e.dot(s), s.square(), e.dot(rest), s.dot(rest)];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
            for (taken, change) in taken.iter_mut().zip([e, s]) {
                taken[0] += m.conj() * change;
                taken[1] += n.conj() * change;
            }
        }
        let [e, s] = taken.map(|right| equations.solve(right, scale));
        let product = |x: [Complex; 2], y: [Complex; 2]| x[0].dot(y[0]) + x[1].dot(y[1]);
        let weight = 1.0 / self.signals.variance;
        Some(EdgeFit {
            edge,
            cost: weight * rest,
            // Of two complex brightnesses and a place.
            freedom: 2.0 * count - 5.0,
            matrix: [
                weight * (sums[0] - product(taken[0], e)),
                weight * (sums[1] - product(taken[0], s)),
                weight * (sums[2] - product(taken[1], s)),
            ],
            right: [weight * sums[3], weight * sums[4]],
            material: b.re,
            background: a.length() / b.length(),
            strength: weight * b.square() * count,
            off: libm::fabs(b.turns()),
        })
    }

    /// The light of the background with each level times its share of the mean ratio, as it would be
    /// in the middle of the piece; `None` if no pixel sees it alone.
    fn rated(&self, edge: f64) -> Option<Complex> {
        let half = self.edge.reach() / 2.0;
        let (mut sum, mut count) = (Complex::default(), 0.0);
        for pixel in self.pixels {
            if (-BAND..edge - half).contains(&pixel.d) && pixel.border < -half {
                sum += pixel.rated * pixel.floor.conj();
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum * (1.0 / count))
    }

    /// What the levels' sum of background lacks to be a times its share, which is less than 1 by
    /// `less`.
    fn shifted(&self, pixel: &Pixel, less: Complex, rated: Option<Complex>) -> Complex {
        let Some(rated) = rated else {
            return Complex::default();
        };
        let here = rated * pixel.floor;
        let share = (1.0 - less.re) / self.signals.leading;
        (rated - here) * share + here * Complex::new(0.0, less.im)
    }

    /// What a pixel at this distance from the edge, and at this one from another border of the
    /// background, sees.
    fn seen(&self, pixel: &Pixel, d: f64, border: f64, rated: Option<Complex>) -> SeenPixel {
        let real = |re: f64| Complex::new(re, 0.0);
        let light = |[share, moment, spread]: [f64; 3], gradient: f64| {
            let k = TAU * self.signals.ratio * gradient;
            Complex::new(share - k * k / 2.0 * spread, k * moment)
        };
        let gradient = self.piece.gradient;
        let profile = self.edge.at(d);
        let material = light(profile.parts(), gradient);
        // The derivatives with e are those with d, less.
        let along = light(profile.along(d, &self.edge), gradient) * -1.0;
        let wider = profile.widening(&self.edge);
        // What the background loses, and how that changes.
        let (mut less, mut follow, mut widens) = (material, along, wider);
        let faces = pixel.follow < 0.0;
        if border > d || faces {
            let profile = self.edge.at(border);
            let whole = light(profile.parts(), pixel.gradient);
            let wider = profile.widening(&self.edge);
            if faces {
                less += whole;
                widens += wider;
            } else {
                let along = light(profile.along(border, &self.edge), pixel.gradient);
                (less, follow, widens) = (whole, along * -pixel.follow, wider);
            }
        }
        let background = match rated {
            Some(_) => real(1.0 - less.re),
            None => real(1.0) - less,
        };
        let mut seen = SeenPixel {
            whole: [material, background],
            along: [along, follow * -1.0],
            wider: [wider, -widens],
            light: pixel.light + self.shifted(pixel, less, rated),
        };
        if let Some(wall) = &self.piece.wall {
            self.add_wall(wall, d, profile, &mut seen);
        }
        seen
    }

    /// Adds the light of the wall.
    fn add_wall(&self, wall: &Wall, d: f64, near: EdgeProfile, seen: &mut SeenPixel) {
        let per_px = TAU * wall.turns / wall.width;
        let k = self.signals.ratio * (TAU * self.piece.gradient - per_px);
        let angle = -per_px / TAU * d;
        let turned = self
            .signals
            .sum(self.damped, |ratio| Complex::turned(ratio * angle))
            * wall.brightness;
        let (edge, beyond) = (&self.edge, d + wall.width);
        let far = edge.at(beyond);
        let light = |far: [f64; 3], near: [f64; 3]| {
            let [share, moment, spread] = [0, 1, 2].map(|i| far[i] - near[i]);
            turned * Complex::new(share - k * k / 2.0 * spread, k * moment)
        };
        let whole = light(far.parts(), near.parts());
        let along = light(far.along(beyond, edge), near.along(d, edge));
        let phase = whole * Complex::new(0.0, self.signals.ratio * per_px);
        seen.whole[0] += whole;
        seen.along[0] += phase - along;
        seen.wider[0] += turned.re * (far.widening(edge) - near.widening(edge));
    }
}

/// Normal equations of two complex unknowns, the brightness of material and of background.
#[derive(Clone, Copy, Debug, Default)]
struct BrightnessEquations {
    mm: f64,
    nn: f64,
    /// Σ m̄ n.
    mn: Complex,
    /// Σ m̄ w and Σ n̄ w.
    right: [Complex; 2],
}

impl BrightnessEquations {
    fn add(&mut self, seen: &SeenPixel) {
        let [m, n] = seen.whole;
        self.mm += m.square();
        self.nn += n.square();
        self.mn += m.conj() * n;
        self.right[0] += m.conj() * seen.light;
        self.right[1] += n.conj() * seen.light;
    }

    fn lift(&mut self, by: f64) {
        self.mm += by;
        self.nn += by;
    }

    /// One over the determinant; `None` if nothing determines the unknowns.
    fn scale(&self) -> Option<f64> {
        let determinant = self.mm * self.nn - self.mn.square();
        (determinant > 0.0).then(|| 1.0 / determinant)
    }

    /// The solution for a right side.
    fn solve(&self, right: [Complex; 2], scale: f64) -> [Complex; 2] {
        [
            (right[0] * self.nn - self.mn * right[1]) * scale,
            (right[1] * self.mm - self.mn.conj() * right[0]) * scale,
        ]
    }
}
