//! The edge of a side: a circle tangent to its line, through the heights that leave the line.
//!
//! # Idea
//! Heights near the rim are wrong: a pixel there averages the phase of a curved surface, and
//! beyond the silhouette of a floor. The first follows from the profile and is a part of what is
//! fitted ([`Blurred`]); a share [`BLUR`] of it is uncertain. The second is not known: a height
//! gets the variance that the floor's share of the pixel makes, less if no heights follow behind
//! the edge, so that the floor is dark. What is still off the circle loses its weight (Tukey).
//!
//! # Stages
//! The bins that are one surface, leave the line by more than 3 σ and fall ever more steeply, which
//! a floor does not; the circle on which most of them lie, among radii in steps of a fifth; least
//! squares about it; the same from bins without the points that are off that circle.
//!
//! # Covariance
//! With p the fitted of (t, r), ρ_i = N⁻¹ w_i j_i by how much a residual changes it, N = Σ w j jᵀ,
//! and the line's parameters L,
//!
//! ```text
//! ∂p/∂L = −Σ ρ_i ∂d_i/∂L = G      C_p = Σ ρ_i ρ_iᵀ σ_i² + G C_L Gᵀ      C_pL = G C_L
//! ```

use super::bins::{Bin, Zone};
use super::line::Line;
use super::profile::{Blurred, Directions, Rounded, Stated};
use super::reason::Why;
use super::request::Optics;
use crate::math::associate::{Distance, Point, associate};
use crate::math::solve::Normal;
use alloc::vec::Vec;

/// The arc that determines a radius, °.
const ARC: f64 = 30.0;
/// The arc that determines where a circle of stated radius is, °.
const STATED_ARC: f64 = 10.0;
/// A height leaves the line by more σ than this.
const LEAVES: f64 = 3.0;
/// The share of δ by which it is uncertain.
pub const BLUR: f64 = 0.15;
/// An edge falls, from where it leaves the line, at least at this share of its steepest slope.
const STEEPER: f64 = 0.8;
/// A bin of more variance than so many times that by noise is not seen well enough to count.
const KNOWN: f64 = 3.0;
/// What a lit floor adds to a height, mm: its share of the pixel times a turn's depth over 2π.
const MIX: f64 = 1.0;
/// The same of a floor too dark for heights.
const DARK: f64 = 0.1;
/// Heights follow within so many blurs behind an edge above a lit floor.
const LIT: f64 = 6.0;
/// The largest σ of a radius that is found, of it: above, several circles fit as pixels see them.
const CERTAIN: f64 = 0.04;
/// A ray that passes the circle farther away than this, in blurs, sees something else.
const PASSES: f64 = 2.0;
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
/// Rounds of the weights that follow from the profile.
const ROUNDS: usize = 3;
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
    let all = zone.bins(|_, _, _| true);
    let connected = zone.connected(&all, optics);
    let arc = leaving(&all[..connected], optics.blur);
    let next = all.get(connected).zip(arc.last());
    let lit = next.is_some_and(|(next, last)| next.x - last.x < LIT * optics.blur);
    let search = Search {
        line: zone.line,
        mix: if lit { MIX } else { DARK },
        rounded: Rounded(directions),
        seen: Blurred {
            rounded: Rounded(directions),
            blur: optics.blur,
        },
    };
    if arc.len() < BINS {
        return Err(Why::Edgeless);
    }
    let first = search.solve(arc, stated, None)?;
    let [.., t, r] = first.parameters;
    let bins = zone.bins(|x, y, variance| search.is_near([t, r], (x, y), variance));
    let from = (!first.is_stated).then_some([t, r]);
    search.solve(leaving(&bins, optics.blur), stated, from)
}

/// The bins from the first few that all leave the line, as long as they fall ever more steeply. Light
/// ends along an edge, so the last may be too noisy to leave it.
fn leaving(bins: &[Bin], blur: f64) -> &[Bin] {
    let leaves = |bin: &Bin| bin.y > LEAVES * libm::sqrt(bin.variance);
    let Some(first) = bins.windows(BINS).position(|run| run.iter().all(leaves)) else {
        return &[];
    };
    let (before, behind) = bins.split_at(first);
    // From a little before, so that the slopes of the first are not those of their noise.
    let from = before.last().map_or(0.0, |bin| bin.x) - blur;
    let mut steepest = 0.0_f64;
    let flat = behind.iter().position(|bin| {
        let far = bin.x - from;
        let noise = LEAVES * libm::sqrt(bin.variance);
        let is_flat = bin.y + noise < STEEPER * steepest * far;
        steepest = steepest.max((bin.y - noise) / far);
        is_flat
    });
    &behind[..flat.unwrap_or(behind.len())]
}

struct Search<'a> {
    line: &'a Line,
    mix: f64,
    rounded: Rounded,
    seen: Blurred,
}

impl Search<'_> {
    /// The edge by the radius that is found, or the stated one if too little of the arc is seen.
    fn solve(
        &self,
        bins: &[Bin],
        stated: Option<f64>,
        from: Option<[f64; 2]>,
    ) -> Result<Edge, Why> {
        let found = self.with(bins, None, from);
        let found = found.and_then(|edge| {
            let (r, sigma) = (edge.parameters[3], libm::sqrt(edge.covariance[3][3]));
            let uncertain = Why::Uncertain { sigma, r };
            if sigma <= CERTAIN * r {
                Ok(edge)
            } else {
                Err(uncertain)
            }
        });
        let enough = found.is_ok_and(|edge| edge.arc.to_degrees() >= ARC);
        let (edge, needs) = match stated {
            Some(r) if !enough => (self.with(bins, Some(r), None)?, STATED_ARC),
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

    fn with(&self, bins: &[Bin], stated: Option<f64>, from: Option<[f64; 2]>) -> Result<Edge, Why> {
        let start = from.or_else(|| self.start(bins, stated));
        let mut p = start.ok_or(Why::NotRound)?;
        let (mut points, mut seen) = (Vec::new(), Vec::new());
        let mut ratios = Vec::new();
        for _ in 0..ROUNDS {
            self.usable(bins, p, &mut points, &mut seen);
            if points.len() < BINS {
                let arc = seen.iter().map(|seen| seen.arc).fold(0.0, f64::max);
                return Err(Why::ShortArc {
                    degrees: arc.to_degrees(),
                    needs: if stated.is_some() { STATED_ARC } else { ARC },
                    stated: stated.is_some(),
                });
            }
            let found = match stated {
                None => associate(&self.seen, &mut p, &mut points, &mut ratios).map(|_| ()),
                Some(r) => {
                    let (mut t, stated) = ([p[0]], Stated(self.seen, r));
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

    /// The circle on which most bins lie, with what blur does to them.
    fn start(&self, bins: &[Bin], stated: Option<f64>) -> Option<[f64; 2]> {
        let mut best: Option<(f64, [f64; 2])> = None;
        let (mut points, mut seen, mut places) = (Vec::new(), Vec::new(), Vec::new());
        let mut r = stated.unwrap_or(RADII[0]);
        loop {
            points.clear();
            let all = bins.iter().map(|bin| (bin.x, bin.y));
            let Some(mut t) = place(all, r, &mut places) else {
                r *= RATIO;
                if r > RADII[1] || stated.is_some() {
                    break;
                }
                continue;
            };
            for _ in 0..2 {
                self.usable(bins, [t, r], &mut points, &mut seen);
                let up = self.rounded.0.sight.1;
                let moved = points.iter().zip(&seen);
                let moved = moved.map(|(point, seen)| (point.x, point.y + seen.off * up));
                t = place(moved, r, &mut places).unwrap_or(t);
            }
            let missing = self.usable(bins, [t, r], &mut points, &mut seen);
            let costs = points.iter().zip(&seen).map(|(point, seen)| {
                let square = seen.way * seen.way / point.variance;
                square.min(OFF * OFF) + libm::log(point.variance / seen.noise)
            });
            let cost = missing + costs.sum::<f64>();
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, [t, r]));
            }
            r *= RATIO;
            if r > RADII[1] || stated.is_some() {
                break;
            }
        }
        best.map(|(_, p)| p)
    }

    /// The bins that a ray meets, and how they are seen; and what the others cost.
    fn usable(
        &self,
        bins: &[Bin],
        p: [f64; 2],
        points: &mut Vec<Point>,
        seen: &mut Vec<Seen>,
    ) -> f64 {
        points.clear();
        seen.clear();
        let mut missed = 0.0;
        for bin in bins {
            let inside = self.rounded.inside(p, bin.x, bin.y) / self.seen.blur;
            let leak = self.mix * 0.5 * libm::erfc(inside * core::f64::consts::FRAC_1_SQRT_2);
            let Some(hit) = self.rounded.hit(p, bin.x, bin.y) else {
                missed += libm::log(1.0 + leak * leak / bin.variance)
                    + if inside < -PASSES { OFF * OFF } else { 1.0 };
                continue;
            };
            let off = self.seen.distance(&p, bin.x, bin.y) + hit.way;
            points.push(Point {
                x: bin.x,
                y: bin.y,
                variance: bin.variance + BLUR * BLUR * off * off + leak * leak,
                weight: 1.0,
            });
            seen.push(Seen {
                noise: bin.variance,
                off,
                way: off - hit.way,
                arc: libm::asin(hit.normal.0.clamp(-1.0, 1.0)),
            });
        }
        missed
    }

    /// Whether a point is near enough to the profile to be a part of it.
    fn is_near(&self, p: [f64; 2], (x, y): (f64, f64), variance: f64) -> bool {
        let Some(hit) = self.rounded.hit(p, x, y) else {
            return false;
        };
        // What blur does grows with the slope of the surface.
        let facing = hit.normal.0 * self.rounded.0.sight.0 + hit.normal.1 * self.rounded.0.sight.1;
        let slack = self.seen.blur * self.seen.blur / (p[1] * facing * facing * facing);
        libm::fabs(hit.way) <= OUTSIDE * libm::sqrt(variance) + slack
    }

    /// The edge with its covariance.
    fn edge(&self, p: [f64; 2], points: &[Point], seen: &[Seen], is_stated: bool) -> Option<Edge> {
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
            if point.weight > COUNTS && point.variance < KNOWN * seen.noise {
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
        let (h, a) = (self.line.stretch(), self.line.slope);
        let (x, y) = (point.x, point.y);
        let [t, r] = self.seen.derivative(&p, x, y);
        let lift = self.seen.lifted(&p, x, y);
        // The line lifts the profile by 1/h and moves it along by a/h for each mm, and turns it
        // about its middle by 1/h² for each unit of slope.
        [(t * a + lift) / h, (t * y + lift * x) / (h * h), t, r]
    }
}

/// The tangent point of circles of radius r through points of an edge: the median.
fn place(points: impl Iterator<Item = (f64, f64)>, r: f64, places: &mut Vec<f64>) -> Option<f64> {
    places.clear();
    let placing = points.filter(|(_, y)| (0.0..PLACES * r).contains(y));
    places.extend(placing.map(|(x, y)| x - libm::sqrt((2.0 * r - y) * y)));
    let middle = places.len() / 2;
    (!places.is_empty()).then(|| *places.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// How a bin is seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Its variance by noise, mm².
    noise: f64,
    /// δ, mm.
    off: f64,
    /// Its residual, mm.
    way: f64,
    /// Where on the arc, rad from the tangent point.
    arc: f64,
}
