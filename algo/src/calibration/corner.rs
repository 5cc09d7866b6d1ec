//! One inner corner of a checkerboard, to a few hundredths of a pixel: a model of the picture about
//! it, fitted by least squares.
//!
//! I(p) = (1 + g·d)·(a + b·erf(s₁/√2σ)·erf(s₂/√2σ)), d = p − corner, s_i = d·n_i with the normals
//! n_i of the two edges at angles θ_i: two edges blurred by a Gaussian of σ px under light that
//! falls off linearly. The model is exact for edges at right angles; for others it is symmetric
//! about the corner, as is the blurred corner itself, so it has no bias. Nine unknowns (u, v, θ₁,
//! θ₂, σ, a, b, g), Levenberg (1944) and Marquardt (1963). Corner and edges together are located
//! with all of the contrast in the window, and σ says how sharp the picture is.

use super::candidates::GreyPicture;
use crate::math::solve::Normal;

/// Unknowns.
const N: usize = 9;
/// Most steps of the fit; it takes 5 to 10.
const STEPS: usize = 30;
/// The fit has converged when the corner moves less than this, px.
const STILL: f64 = 1e-4;
/// Least blur of a picture, px: sharper edges lie between two pixels and have no width that could
/// be measured.
const SHARPEST: f64 = 0.2;
/// Least share of the picture's variance in the window that the model must explain.
const LEAST_EXPLAINED: f64 = 0.75;

/// A located corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Corner {
    /// Column, px.
    pub u: f64,
    /// Row, px.
    pub v: f64,
    /// σ of the edges' blur, px.
    pub blur: f64,
}

/// Locates the corner near (u, v) with the pixels within `radius` of it; `edges` are the directions
/// of its two edges. `None` where the picture there is not that of a corner.
pub(super) fn locate(
    picture: &GreyPicture,
    (u, v): (f64, f64),
    edges: [(f64, f64); 2],
    radius: f64,
) -> Option<Corner> {
    let window = CornerWindow::new(picture, (u, v), radius)?;
    let angle = |(x, y): (f64, f64)| libm::atan2(y, x);
    let mut fit = [
        u,
        v,
        angle(edges[0]),
        angle(edges[1]),
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
    ];
    window.contrast(&mut fit)?;
    let (mut damping, mut cost) = (1e-3, window.cost(&fit));
    for _ in 0..STEPS {
        let mut normal = window.normal(&fit);
        for i in 0..N {
            normal.matrix[i][i] *= 1.0 + damping;
        }
        let step = normal.solve()?;
        let mut next = fit;
        next.iter_mut().zip(&step).for_each(|(x, dx)| *x += dx);
        next[4] = next[4].clamp(SHARPEST, radius / 2.0);
        // A step that leads to another corner is taken back, as one that raises the cost.
        let near = libm::hypot(next[0] - u, next[1] - v) <= radius / 2.0;
        let found = window.cost(&next);
        if near && found <= cost {
            let moved = libm::hypot(step[0], step[1]);
            (fit, cost, damping) = (next, found, damping * 0.1);
            if moved < STILL {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    window.corner(&fit, cost)
}

/// The pixels about a corner.
struct CornerWindow<'a> {
    picture: &'a GreyPicture,
    columns: (usize, usize),
    rows: (usize, usize),
    centre: (f64, f64),
    radius: f64,
}

impl<'a> CornerWindow<'a> {
    fn new(picture: &'a GreyPicture, (u, v): (f64, f64), radius: f64) -> Option<Self> {
        let range = |at: f64, size: usize| {
            let (low, high) = (libm::ceil(at - radius), libm::floor(at + radius));
            (low >= 0.0 && high < size as f64).then_some((low as usize, high as usize))
        };
        Some(Self {
            picture,
            columns: range(u, picture.width)?,
            rows: range(v, picture.height)?,
            centre: (u, v),
            radius,
        })
    }

    /// Column, row and counts of each pixel in the circle.
    fn pixels(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let square = self.radius * self.radius;
        (self.rows.0..=self.rows.1).flat_map(move |v| {
            (self.columns.0..=self.columns.1).filter_map(move |u| {
                let (x, y) = (u as f64 - self.centre.0, v as f64 - self.centre.1);
                let inside = x * x + y * y <= square;
                inside.then(|| (u as f64, v as f64, f64::from(self.picture.at(u, v))))
            })
        })
    }

    /// First values of a and b: the means of the two pairs of quadrants.
    fn contrast(&self, fit: &mut [f64; N]) -> Option<()> {
        let mut sums = [(0.0, 0.0); 2];
        let model = Model::new(fit);
        for (u, v, counts) in self.pixels() {
            let side = |at| model.edge(at, u - fit[0], v - fit[1]).side;
            let sum = &mut sums[usize::from(side(0) * side(1) > 0.0)];
            *sum = (sum.0 + counts, sum.1 + 1.0);
        }
        if sums.iter().any(|sum| sum.1 < 8.0) {
            return None;
        }
        let [other, same] = sums.map(|(sum, n)| sum / n);
        (fit[5], fit[6]) = ((same + other) / 2.0, (same - other) / 2.0);
        Some(())
    }

    fn cost(&self, fit: &[f64; N]) -> f64 {
        let model = Model::new(fit);
        let squares = self.pixels().map(|(u, v, counts)| {
            let off = counts - model.counts(u, v);
            off * off
        });
        squares.sum()
    }

    /// Normal equations of a step.
    fn normal(&self, fit: &[f64; N]) -> Normal<N> {
        let model = Model::new(fit);
        Normal::of(self.pixels().map(|(u, v, counts)| {
            let (value, slopes) = model.slopes(u, v);
            (slopes, counts - value)
        }))
    }

    /// The corner, if the model explains the picture.
    fn corner(&self, fit: &[f64; N], cost: f64) -> Option<Corner> {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (_, _, counts) in self.pixels() {
            n += 1.0;
            sum += counts;
            squares += counts * counts;
        }
        let variance = squares - sum * sum / n;
        (cost <= (1.0 - LEAST_EXPLAINED) * variance).then_some(Corner {
            u: fit[0],
            v: fit[1],
            blur: fit[4],
        })
    }
}

/// The model with what does not depend on the pixel.
struct Model {
    fit: [f64; N],
    /// Sine and cosine of the edges' angles.
    edges: [(f64, f64); 2],
}

/// An edge at a pixel.
struct BlurredEdge {
    /// erf(s/√2σ).
    step: f64,
    /// The derivative of that with s.
    slope: f64,
    /// s.
    side: f64,
}

impl Model {
    fn new(fit: &[f64; N]) -> Self {
        let edge = |angle: f64| (libm::sin(angle), libm::cos(angle));
        Self {
            fit: *fit,
            edges: [edge(fit[2]), edge(fit[3])],
        }
    }

    fn edge(&self, at: usize, x: f64, y: f64) -> BlurredEdge {
        let sigma = self.fit[4];
        let (sin, cos) = self.edges[at];
        let side = y * cos - x * sin;
        let t = side / (core::f64::consts::SQRT_2 * sigma);
        // d erf(s/√2σ)/ds = √(2/π)/σ · exp(−s²/2σ²)
        let scale = libm::sqrt(2.0 / core::f64::consts::PI) / sigma;
        BlurredEdge {
            step: libm::erf(t),
            slope: scale * libm::exp(-t * t),
            side,
        }
    }

    /// The counts at a pixel.
    fn counts(&self, u: f64, v: f64) -> f64 {
        let [cu, cv, _, _, _, a, b, gu, gv] = self.fit;
        let (x, y) = (u - cu, v - cv);
        let colour = a + b * self.edge(0, x, y).step * self.edge(1, x, y).step;
        (1.0 + gu * x + gv * y) * colour
    }

    /// The counts at a pixel and their derivatives.
    fn slopes(&self, u: f64, v: f64) -> (f64, [f64; N]) {
        let [cu, cv, _, _, sigma, a, b, gu, gv] = self.fit;
        let (x, y) = (u - cu, v - cv);
        let (first, second) = (self.edge(0, x, y), self.edge(1, x, y));
        let light = 1.0 + gu * x + gv * y;
        let colour = a + b * first.step * second.step;
        // Derivatives of the colour with s₁ and s₂.
        let by_first = b * first.slope * second.step;
        let by_second = b * first.step * second.slope;
        let [(sin1, cos1), (sin2, cos2)] = self.edges;
        // Derivatives of the colour with the pixel's place.
        let across = -by_first * sin1 - by_second * sin2;
        let down = by_first * cos1 + by_second * cos2;
        let slopes = [
            -light * across - gu * colour,
            -light * down - gv * colour,
            light * by_first * (-y * sin1 - x * cos1),
            light * by_second * (-y * sin2 - x * cos2),
            light * (-by_first * first.side - by_second * second.side) / sigma,
            light,
            light * first.step * second.step,
            colour * x,
            colour * y,
        ];
        (light * colour, slopes)
    }
}
