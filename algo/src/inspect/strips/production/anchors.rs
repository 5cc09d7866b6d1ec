//! Which contours a part is placed by whose heights leave its motion open.

use crate::geometry::Vector;
use crate::inspect::strips::accumulate::Gauge;
use crate::inspect::strips::readings::{Contours, ExpectedContour, PlaneFit};
use alloc::vec::Vec;

/// Contours that a part is placed by at most.
pub const MOST: usize = 4;
/// Fewer determine nothing.
pub const LEAST: usize = 2;

/// The numbers of these contours.
pub type Anchors = heapless::Vec<usize, MOST>;

/// The contours that a part is placed by: as far apart as there are. A contour whose own place is measured in the
/// frame as taught is none of them.
pub fn anchors(contours: &Contours, planes: &[PlaneFit], gauges: &[Gauge]) -> Anchors {
    let is_placed = |feature: usize| {
        let mut gauges = gauges.iter().filter(|gauge| gauge.datum.is_empty());
        gauges.any(|gauge| gauge.measure.facts().datum && gauge.of.contains(&feature))
    };
    let place = |(at, expected): (usize, &ExpectedContour)| {
        let frame = contours.frame(expected, planes.get(expected.plane)?)?;
        let (x, y) = expected.outline.middle();
        let serves = expected.kind.is_opening() && !is_placed(expected.feature);
        serves.then(|| (at, frame.point(x, y)))
    };
    let places: Vec<(usize, Vector)> = contours.all.iter().enumerate().filter_map(place).collect();
    let mut taken = heapless::Vec::<Vector, MOST>::new();
    let mut chosen = Anchors::new();
    for _ in 0..MOST.min(places.len()) {
        // From the nearest that is taken; the first to be taken is any.
        let apart = |at: Vector| {
            let ways = taken.iter().map(|taken| (at - *taken).length());
            ways.fold(f64::INFINITY, f64::min)
        };
        let free = places.iter().filter(|(at, _)| !chosen.contains(at));
        if let Some(&(at, place)) = free.max_by(|a, b| apart(a.1).total_cmp(&apart(b.1))) {
            let _ = (chosen.push(at), taken.push(place));
        }
    }
    match chosen.len() < LEAST {
        true => Anchors::new(),
        false => chosen,
    }
}
