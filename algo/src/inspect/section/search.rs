//! Where to begin: the circle on which most bins lie, with what blur does to them.
//!
//! Of each radius the tangent point is the median of those that single bins have, and the cost
//!
//! ```text
//! Σ K ln(1 + d²/(K σ²)) + ln(σ²/σ₀²)        σ₀² a bin's variance by noise
//! ```
//!
//! has one valley over log r, as it neither cuts off what is far away nor lets it dominate. Radii
//! that double find it, halving steps its bottom.

use super::bins::Bin;
use super::view::SideView;
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
