//! The circle of an edge, tangent to its line: first the one on which most bins lie, with what blur
//! does to them, and from there by least squares.
//!
//! # First circle
//! Of each radius the tangent point is the median of those that single bins have, and the cost
//!
//! ```text
//! Σ K ln(1 + d²/(K σ²)) + ln(σ²/σ₀²)        σ₀² a bin's variance by noise
//! ```
//!
//! has one valley over log r, as it neither cuts off what is far away nor lets it dominate. Radii
//! that double find it, halving steps its bottom.
//!
//! # Least squares
//! Gauss–Newton over Σ ρ(d/σ), ρ Tukey's biweight (J. W. Tukey; P. W. Holland & R. E. Welsch, Commun.
//! Stat. A 6, 1977: c = 4.685), scaled by the median of |d|/σ where bins scatter by more than σ,
//! which follows from the circle and is worked out anew in each round.

use super::bins::Bin;
use super::profile::{Rates, SeenBin, SideView};
use crate::math::solve::Normal;
use alloc::vec::Vec;

/// Radii that are looked for, mm.
pub const RADII: [f64; 2] = [0.15, 12.0];
/// Their ratios: in the first round, then beside the best one.
const RATIOS: [f64; 4] = [2.0, 1.414, 1.189, 1.09];
/// The deepest bins that place a circle, of its radius: 66°.
const PLACES: f64 = 0.6;
/// K, degrees of freedom of Student's t.
const TAILS: f64 = 4.0;
/// What a bin costs that sees something else.
const OFF: f64 = 16.0;

/// The circle (t, r) on which most bins lie, of the stated radius or of any; `None` if no bin places
/// one.
pub fn search(view: &SideView, bins: &[Bin], stated: Option<f64>) -> Option<[f64; 2]> {
    let mut places = Vec::with_capacity(bins.len());
    let mut best: Option<(f64, [f64; 2])> = None;
    let mut attempt = |r: f64, best: &mut Option<(f64, [f64; 2])>| {
        let Some(p) = placed(view, bins, r, &mut places) else {
            return;
        };
        let cost = cost(view, bins, p);
        if best.is_none_or(|(least, _)| cost < least) {
            *best = Some((cost, p));
        }
    };
    if let Some(r) = stated {
        attempt(r, &mut best);
        return best.map(|(_, p)| p);
    }
    let mut r = RADII[0];
    while r <= RADII[1] {
        attempt(r, &mut best);
        r *= RATIOS[0];
    }
    for ratio in &RATIOS[1..] {
        let (_, [_, r]) = best?;
        attempt(r / ratio, &mut best);
        attempt(r * ratio, &mut best);
    }
    best.map(|(_, p)| p)
}

/// The circle of a radius, placed by bins without what blur does to them.
fn placed(view: &SideView, bins: &[Bin], r: f64, places: &mut Vec<f64>) -> Option<[f64; 2]> {
    let place = |y: f64, x: f64| {
        let is_placing = (0.0..PLACES * r).contains(&y);
        is_placing.then(|| x - libm::sqrt((2.0 * r - y) * y))
    };
    places.clear();
    places.extend(bins.iter().filter_map(|bin| place(bin.y, bin.x)));
    let p = [median(places)?, r];
    places.clear();
    places.extend(bins.iter().filter_map(|bin| {
        let seen = view.seen(p, bin)?;
        place(bin.y + seen.off * view.profile.up(), bin.x)
    }));
    Some([median(places).unwrap_or(p[0]), r])
}

/// The value in the middle, or above it.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn cost(view: &SideView, bins: &[Bin], p: [f64; 2]) -> f64 {
    let costs = bins.iter().map(|bin| match view.seen(p, bin) {
        None => view.passed(p, bin, OFF),
        Some(seen) => {
            let square = seen.way * seen.way / seen.variance;
            TAILS * libm::log(1.0 + square / TAILS) + libm::log(seen.variance / bin.variance)
        }
    });
    costs.sum()
}

/// Fewest bins of an edge.
pub const BINS: usize = 3;
/// Tukey's c: 95 % efficient on normal errors.
const TUKEY: f64 = 4.685;
/// The median of |x| of a standard normal x.
const MEDIAN: f64 = 0.674_489_750_196_081_7;
/// The largest step of an end, mm.
const STILL: f64 = 1e-5;
/// The largest change of a radius in a round, of it.
const CHANGE: f64 = 0.5;

/// What a bin says about the circle.
#[derive(Clone, Copy, Debug)]
pub struct FitRow {
    /// The bin.
    pub bin: Bin,
    /// How it sees the circle.
    pub seen: SeenBin,
    /// How its residual changes.
    pub rates: Rates,
    /// Tukey's weight, 0 to 1.
    pub weight: f64,
}

/// A circle and what it was fitted to.
#[derive(Clone, Debug, Default)]
pub struct CircleFit {
    /// t, r.
    pub p: [f64; 2],
    /// Its bins, as they see it.
    pub rows: Vec<FitRow>,
    ratios: Vec<f64>,
}

impl CircleFit {
    /// From this circle.
    pub fn new(p: [f64; 2]) -> Self {
        Self {
            p,
            ..Self::default()
        }
    }

    /// Moves the circle to where its bins' residuals are least, in so many rounds at most; a stated
    /// radius is kept. `None` where the bins do not determine it.
    pub fn solve(
        &mut self,
        view: &SideView,
        bins: &[Bin],
        is_stated: bool,
        rounds: usize,
    ) -> Option<()> {
        for _ in 0..rounds {
            self.look(view, bins);
            let mut normal = Normal::<2>::default();
            for row in &self.rows {
                let root = libm::sqrt(row.weight / row.seen.variance);
                let r = if is_stated { 0.0 } else { row.rates.r };
                normal.add(&[row.rates.t * root, r * root], -row.seen.way * root);
            }
            if is_stated {
                normal.matrix[1][1] = 1.0;
            }
            let [t, r] = normal.solve()?;
            let most = CHANGE * self.p[1];
            self.p[0] += t;
            self.p[1] += r.clamp(-most, most);
            let is_sound = self.p[1] > RADII[0] / 2.0 && self.p[1] < 2.0 * RADII[1];
            if !(self.p[0].is_finite() && (is_sound || is_stated)) {
                return None;
            }
            if libm::fabs(t).max(libm::fabs(r)) < STILL {
                break;
            }
        }
        self.look(view, bins);
        (self.rows.len() >= BINS).then_some(())
    }

    /// How the bins see the circle where it is, and their weights.
    fn look(&mut self, view: &SideView, bins: &[Bin]) {
        let (p, profile) = (self.p, &view.profile);
        self.rows.clear();
        self.rows.extend(bins.iter().filter_map(|&bin| {
            let seen = view.seen(p, &bin)?;
            let rates = profile.rates(seen.ray.inside, p[1], seen.seen);
            let weight = 1.0;
            Some(FitRow {
                bin,
                seen,
                rates,
                weight,
            })
        }));
        let ratio = |row: &FitRow| libm::fabs(row.seen.way) / libm::sqrt(row.seen.variance);
        self.ratios.clear();
        self.ratios.extend(self.rows.iter().map(ratio));
        let scale = match median(&mut self.ratios) {
            Some(median) => (median / MEDIAN).max(1.0),
            None => 1.0,
        };
        for row in &mut self.rows {
            let outside = ratio(row) / (scale * TUKEY);
            let inside = (1.0 - outside * outside).max(0.0);
            row.weight = inside * inside;
        }
    }
}
