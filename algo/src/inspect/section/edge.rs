//! The edge of a side: a circle tangent to its line, through the heights that leave the line.
//!
//! # Idea
//! Heights near the rim are wrong: a pixel there averages the phase of a curved surface, and
//! beyond the silhouette of a floor. The first is known from the profile itself and taken back
//! ([`Rounded::blurred`]); how well decides what a height counts. The second is not known: rays
//! that pass nearer to the silhouette than [`CLEAR`] blurs are left out, and what is still off the
//! circle loses its weight (Tukey).
//!
//! # Stages
//! The bins that are one surface and leave the line by more than 3 σ; the circle on which most of
//! them lie, among radii in steps of a fifth; least squares about it, with δ anew in each of a few
//! rounds; the same again from bins without the points that are off that circle.
//!
//! # Covariance
//! With p the fitted of (t, r), ρ_i = N⁻¹ w_i j_i by how much a residual changes it, N = Σ w j jᵀ,
//! and the line's parameters L,
//!
//! ```text
//! ∂p/∂L = −Σ ρ_i ∂d_i/∂L = −G      C_p = Σ ρ_i ρ_iᵀ σ_i² + G C_L Gᵀ      C_pL = −G C_L
//! ```

use super::bins::{Bin, Zone};
use super::line::Line;
use super::profile::{Directions, Rounded, Stated};
use super::reason::Why;
use super::request::Optics;
use crate::math::associate::{Point, associate};
use crate::math::solve::Normal;
use alloc::vec::Vec;

/// The arc that determines a radius, °.
const ARC: f64 = 30.0;
/// The arc that determines where a circle of stated radius is, °.
const STATED_ARC: f64 = 10.0;
/// A height leaves the line by more σ than this.
const LEAVES: f64 = 3.0;
/// A ray passes inside the silhouette by at least so many blurs.
const CLEAR: f64 = 1.5;
/// Least cosine of the angle between the surface's normal and the line of sight.
const FACING: f64 = 0.3;
/// The share of δ by which it is uncertain.
pub const BLUR: f64 = 0.15;
/// Fewest bins of an edge.
const BINS: usize = 3;
/// Radii that are looked for, mm, and their ratio.
const RADII: [f64; 2] = [0.15, 12.0];
const RATIO: f64 = 1.2;
/// The deepest bins that place a circle in the search, of its radius: 66°.
const PLACES: f64 = 0.6;
/// A bin's residual beyond which it does not count in the search, of its uncertainty.
const OFF: f64 = 4.0;
/// A point's residual beyond which it is left out of its bin, σ.
const OUTSIDE: f64 = 5.0;
/// Rounds of δ: each leaves less than a third of the error.
const ROUNDS: usize = 5;
/// A bin of less weight does not end the arc.
const COUNTS: f64 = 0.1;

/// A side: its line, and the circle of its edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// c, a, t, r: height of the line at the middle of its stretch, mm; its slope towards the
    /// joint; the tangent point, mm along the line from that middle; the radius, mm.
    pub parameters: [f64; 4],
    /// Their covariance by noise.
    pub covariance: [[f64; 4]; 4],
    /// Where the middle of the stretch is: x = s on the left, −s on the right, mm.
    pub middle: f64,
    /// The arc that is seen, from the tangent point, rad.
    pub arc: f64,
    /// Whether the radius is the stated one.
    pub is_stated: bool,
    /// By how much the parameters are off if δ is by [`BLUR`].
    pub blurred: [f64; 4],
    /// By how much they are off for 1 mm of a stated radius.
    pub stated: [f64; 4],
}

/// Finds the edge of a side.
pub fn edge(
    zone: &Zone<'_>,
    directions: Directions,
    optics: &Optics,
    stated: Option<f64>,
) -> Result<Edge, Why> {
    let search = Search {
        line: zone.line,
        rounded: Rounded(directions),
        blur: optics.blur,
    };
    let all = zone.bins(|_, _, _| true);
    let arc = leaving(&all[..zone.connected(&all, optics)]);
    if arc.len() < BINS {
        return Err(Why::Edgeless);
    }
    let first = search.solve(arc, stated)?;
    let [.., t, r] = first.parameters;
    let bins = zone.bins(|x, y, variance| search.is_near([t, r], (x, y), variance));
    search.solve(leaving(&bins), stated)
}

/// The bins behind the last that does not leave the line.
fn leaving(bins: &[Bin]) -> &[Bin] {
    let leaves = |bin: &Bin| bin.y > LEAVES * libm::sqrt(bin.variance);
    let from = bins.iter().rposition(|bin| !leaves(bin));
    &bins[from.map_or(0, |last| last + 1)..]
}

struct Search<'a> {
    line: &'a Line,
    rounded: Rounded,
    blur: f64,
}

impl Search<'_> {
    /// The edge by the radius that is found, or the stated one if too little of the arc is seen.
    fn solve(&self, bins: &[Bin], stated: Option<f64>) -> Result<Edge, Why> {
        let found = self.with(bins, None);
        let enough = found.is_ok_and(|edge| edge.arc.to_degrees() >= ARC);
        let (edge, needs) = match stated {
            Some(r) if !enough => (self.with(bins, Some(r))?, STATED_ARC),
            _ => (found?, ARC),
        };
        let degrees = edge.arc.to_degrees();
        match degrees >= needs {
            true => Ok(edge),
            false => Err(Why::ShortArc {
                degrees,
                needs,
                stated: stated.is_some(),
            }),
        }
    }

    fn with(&self, bins: &[Bin], stated: Option<f64>) -> Result<Edge, Why> {
        let mut p = self.start(bins, stated).ok_or(Why::NotRound)?;
        let (mut points, mut seen) = (Vec::new(), Vec::new());
        let mut ratios = Vec::new();
        for _ in 0..ROUNDS {
            self.usable(bins, p, &mut points, &mut seen);
            if points.len() < BINS {
                let arc = seen.iter().map(|seen| seen.arc).fold(0.0, f64::max);
                return Err(Why::ShortArc {
                    degrees: arc.to_degrees(),
                    needs: ARC,
                    stated: stated.is_some(),
                });
            }
            let found = match stated {
                None => associate(&self.rounded, &mut p, &mut points, &mut ratios).map(|_| ()),
                Some(r) => {
                    let (mut t, stated) = ([p[0]], Stated(self.rounded, r));
                    let found = associate(&stated, &mut t, &mut points, &mut ratios);
                    p[0] = t[0];
                    found.map(|_| ())
                }
            };
            let is_sound = p[1] > RADII[0] / 2.0 && p[1] < 2.0 * RADII[1] && p[0].is_finite();
            found
                .filter(|()| is_sound || stated.is_some())
                .ok_or(Why::NotRound)?;
        }
        self.edge(p, &points, &seen, stated.is_some())
            .ok_or(Why::NotRound)
    }

    /// The circle on which most bins lie.
    fn start(&self, bins: &[Bin], stated: Option<f64>) -> Option<[f64; 2]> {
        let mut best: Option<(f64, [f64; 2])> = None;
        let mut places = Vec::new();
        let mut r = stated.unwrap_or(RADII[0]);
        while r <= RADII[1] || stated.is_some() {
            places.clear();
            let placing = bins.iter().filter(|bin| bin.y < PLACES * r);
            places.extend(placing.map(|bin| bin.x - libm::sqrt((2.0 * r - bin.y) * bin.y)));
            if !places.is_empty() {
                let middle = places.len() / 2;
                let (_, &mut t, _) = places.select_nth_unstable_by(middle, f64::total_cmp);
                // What blur does where the arc begins.
                let slack = self.blur * self.blur / (2.0 * r);
                let cost = bins.iter().map(|bin| {
                    let Some(hit) = self.rounded.hit([t, r], bin.x, bin.y) else {
                        return 1.0;
                    };
                    let square = OFF * OFF * (bin.variance + slack * slack);
                    (hit.way * hit.way / square).min(1.0)
                });
                let cost = cost.sum();
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, [t, r]));
                }
            }
            if stated.is_some() {
                break;
            }
            r *= RATIO;
        }
        best.map(|(_, p)| p)
    }

    /// The bins that a ray meets well inside the silhouette, moved back by δ, and how they are seen.
    fn usable(&self, bins: &[Bin], p: [f64; 2], points: &mut Vec<Point>, seen: &mut Vec<Seen>) {
        points.clear();
        seen.clear();
        let (along, up) = self.rounded.0.sight;
        for bin in bins {
            let Some(hit) = self.rounded.hit(p, bin.x, bin.y) else {
                continue;
            };
            let facing = hit.normal.0 * along + hit.normal.1 * up;
            let inside = self.rounded.inside(p, bin.x, bin.y);
            if facing < FACING || inside < CLEAR * self.blur {
                continue;
            }
            let off = self.rounded.blurred(p, (bin.x, bin.y), hit.way, self.blur);
            points.push(Point {
                x: bin.x - off * along,
                y: bin.y + off * up,
                variance: bin.variance + BLUR * BLUR * off * off,
                weight: 1.0,
            });
            seen.push(Seen {
                noise: bin.variance,
                off,
                arc: libm::asin(hit.normal.0.clamp(-1.0, 1.0)),
            });
        }
    }

    /// Whether a point is near enough to the profile to be a part of it.
    fn is_near(&self, p: [f64; 2], (x, y): (f64, f64), variance: f64) -> bool {
        let Some(hit) = self.rounded.hit(p, x, y) else {
            return false;
        };
        // What blur does grows with the slope of the surface.
        let facing = hit.normal.0 * self.rounded.0.sight.0 + hit.normal.1 * self.rounded.0.sight.1;
        let slack = self.blur * self.blur / (p[1] * facing * facing * facing);
        libm::fabs(hit.way) <= OUTSIDE * libm::sqrt(variance) + slack
    }

    /// The edge with its covariance.
    fn edge(&self, p: [f64; 2], points: &[Point], seen: &[Seen], is_stated: bool) -> Option<Edge> {
        let h = self.line.stretch();
        let a = self.line.slope;
        let mut normal = Normal::<2>::default();
        let rates = |point: &Point| self.rates(p, point);
        for point in points {
            let root = libm::sqrt(point.weight / point.variance);
            let [_, _, t, r] = rates(point);
            let r = if is_stated { 0.0 } else { r };
            normal.add(&[t * root, r * root], 0.0);
        }
        if is_stated {
            normal.matrix[1][1] = 1.0;
        }
        let solve = |right: [f64; 2]| Normal { right, ..normal }.solve();
        let inverse = [solve([1.0, 0.0])?, solve([0.0, 1.0])?];
        let mut own = [[0.0; 2]; 2];
        // By how much t and r change with each of c, a and a stated radius.
        let mut by = [[0.0; 3]; 2];
        let mut blurred = [0.0; 4];
        let mut arc = 0.0_f64;
        for (point, seen) in points.iter().zip(seen) {
            let [c, a, t, r] = rates(point);
            let weight = point.weight / point.variance;
            let free = [t * weight, if is_stated { 0.0 } else { r * weight }];
            let row = inverse.map(|row| row[0] * free[0] + row[1] * free[1]);
            for (i, row_i) in row.into_iter().enumerate() {
                for (sum, row_k) in own[i].iter_mut().zip(row) {
                    *sum += row_i * row_k * seen.noise;
                }
                for (sum, rate) in by[i].iter_mut().zip([c, a, r]) {
                    *sum -= row_i * rate;
                }
                blurred[2 + i] += row_i * BLUR * seen.off;
            }
            if point.weight > COUNTS {
                arc = arc.max(seen.arc);
            }
        }
        let line = self.line.covariance;
        let mut covariance = [[0.0; 4]; 4];
        for i in 0..2 {
            for k in 0..2 {
                covariance[i][k] = line[i][k];
                let cross = by[i][0] * line[0][k] + by[i][1] * line[1][k];
                covariance[2 + i][k] = cross;
                covariance[k][2 + i] = cross;
                covariance[2 + i][2 + k] = own[i][k];
            }
        }
        for i in 0..2 {
            for k in 0..2 {
                covariance[2 + i][2 + k] +=
                    covariance[2 + i][0] * by[k][0] + covariance[2 + i][1] * by[k][1];
            }
        }
        let stated = match is_stated {
            true => [0.0, 0.0, by[0][2], 1.0],
            false => [0.0; 4],
        };
        let _ = (h, a);
        let edge = Edge {
            parameters: [self.line.height, self.line.slope, p[0], p[1]],
            covariance,
            middle: self.line.middle,
            arc,
            is_stated,
            blurred,
            stated,
        };
        covariance
            .iter()
            .flatten()
            .all(|x| x.is_finite())
            .then_some(edge)
    }

    /// How a point's residual changes with c, a, t, r.
    fn rates(&self, p: [f64; 2], point: &Point) -> [f64; 4] {
        let Some(hit) = self.rounded.hit(p, point.x, point.y) else {
            return [0.0; 4];
        };
        let (h, a) = (self.line.stretch(), self.line.slope);
        let sight = self.rounded.0.sight;
        let (along, up) = hit.normal;
        let facing = along * sight.0 + up * sight.1;
        // The line lifts the profile by 1/h and moves it along by a/h for each mm, and turns it
        // about its middle by 1/h² for each unit of slope.
        let moved = |x: f64, lift: f64| -(along * x + up * lift) / facing;
        let (x, y) = (point.x, point.y);
        [
            moved(a / h, 1.0 / h),
            moved(y / (h * h), x / (h * h)),
            moved(1.0, 0.0),
            -(1.0 - up) / facing,
        ]
    }
}

/// How a bin is seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Its variance by noise, mm².
    noise: f64,
    /// δ, mm.
    off: f64,
    /// Where on the arc, rad from the tangent point.
    arc: f64,
}
