//! How an edge is found: a circle tangent to its side's line, through the heights that leave it.
//!
//! # Stages
//! The bins that are one surface, leave the line by more than 3 σ and fall ever more steeply, which
//! a floor does not; the circle on which most of them lie (`search`); least squares about it
//! (`fit`); the same of bins without the points that are off that circle.

use super::bins::{Bin, Bins};
use super::circle::{BINS, CircleFit, search};
use super::edge::RoundEdge;
use super::line::StretchLine;
use super::profile::{SideProfile, SideView};
use super::request::{Optics, Why};

/// The arc that determines a radius, °.
const ARC: f64 = 30.0;
/// The arc that determines where a circle of stated radius is, °.
const STATED_ARC: f64 = 10.0;
/// A height leaves the line by more σ than this.
const LEAVES: f64 = 3.0;
/// An edge falls, from where it leaves the line, at least at this share of its steepest slope.
const STEEPER: f64 = 0.8;
/// Heights follow within so many blurs behind an edge above a lit floor.
const LIT: f64 = 6.0;
/// The largest σ of a radius that is found, by noise and blur, of it: above, several circles fit as
/// pixels see them.
const CERTAIN: f64 = 0.04;
/// A point's residual beyond which it is left out of its bin, σ.
const OUTSIDE: f64 = 5.0;
/// Rounds of the first fit, which only says what lies off the circle, and of the last.
const ROUNDS: [usize; 2] = [4, 12];

/// A side whose circle is known well enough to tell which points are off it.
#[derive(Clone, Copy, Debug)]
pub struct Rough {
    line: StretchLine,
    /// 1 on the left, −1 on the right.
    sign: f64,
    stated: Option<f64>,
    view: SideView,
    p: [f64; 2],
}

impl Rough {
    /// Of the points of both sides in bins.
    pub fn new(
        bins: &Bins,
        line: StretchLine,
        sign: f64,
        end: f64,
        optics: &Optics,
        stated: Option<f64>,
    ) -> Result<Self, Why> {
        let all = bins.side(&line, sign);
        let connected = bins.connected(&all, end, optics);
        let arc = leaving(&all[..connected], optics.blur);
        if arc.len() < BINS {
            return Err(Why::Edgeless);
        }
        let next = all.get(connected).zip(arc.last());
        let lit = next.is_some_and(|(next, last)| next.x - last.x < LIT * optics.blur);
        let [sight, light] = [optics.sight, optics.light].map(|slope| {
            let slope = if slope.is_finite() { slope } else { 0.0 };
            let (along, depth) = line.turned(sign * slope, 1.0);
            let length = libm::sqrt(along * along + depth * depth);
            (along / length, -depth / length)
        });
        let view = SideView::new(
            SideProfile::new(sight, light, optics.blur),
            optics.blur,
            lit,
        );
        let start = search(&view, arc, stated).ok_or(Why::NotRound)?;
        let mut fit = CircleFit::new(start);
        fit.solve(&view, arc, stated.is_some(), ROUNDS[0])
            .ok_or(Why::NotRound)?;
        Ok(Self {
            line,
            sign,
            stated,
            view,
            p: fit.p,
        })
    }

    /// Whether a point is near enough to the profile to be a part of it.
    #[inline]
    pub fn is_near(&self, s: f64, z: f64, variance: f64) -> bool {
        let (x, y) = self.line.own(self.sign * s, z);
        let (profile, r) = (&self.view.profile, self.p[1]);
        let ray = profile.ray(self.p, x, y);
        let Some(surface) = profile.surface(ray.inside, r) else {
            return false;
        };
        let off = libm::fabs(ray.way - surface) - OUTSIDE * libm::sqrt(variance);
        // What blur does grows with the slope of the surface.
        off <= 0.0 || {
            let facing = profile.facing(ray.inside, r);
            off * r * facing * facing * facing <= self.view.blur * self.view.blur
        }
    }

    /// The edge, of bins of the points that are near.
    pub fn edge(&self, bins: &Bins) -> Result<RoundEdge, Why> {
        let all = bins.side(&self.line, self.sign);
        let is_stated = self.stated.is_some();
        let mut fit = CircleFit::new(self.p);
        let found = fit.solve(
            &self.view,
            leaving(&all, self.view.blur),
            is_stated,
            ROUNDS[1],
        );
        let edge = found.and_then(|()| RoundEdge::new(&self.line, &self.view, &fit, is_stated));
        let edge = edge.ok_or(Why::NotRound)?;
        let needs = if is_stated { STATED_ARC } else { ARC };
        let (r, sigma) = (edge.parameters[3], edge.radius_sigma());
        let degrees = edge.arc.to_degrees();
        if degrees < needs {
            return Err(Why::ShortArc {
                degrees,
                needs,
                stated: is_stated,
            });
        }
        if !(is_stated || sigma <= CERTAIN * r) {
            return Err(Why::Uncertain { sigma, r });
        }
        Ok(edge)
    }
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
