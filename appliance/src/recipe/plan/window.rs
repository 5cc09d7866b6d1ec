//! The part of the frame that the gauges need.

use algo::inspect::{Gauge, Measure};
use std::ops::Range;

/// The columns of each row of a frame of (width, height) that some gauge needs: its region, half of its smoothing square and
/// `away` pixels around it, by which the part may be displaced. Nothing outside is computed.
pub(super) fn of(
    gauges: &[Gauge],
    (width, height): (usize, usize),
    away: usize,
) -> Vec<Range<usize>> {
    let mut window = vec![0..0; height];
    for gauge in gauges {
        let margin = away
            + match gauge.measure {
                Measure::Deviation { side } => side / 2,
                _ => 0,
            };
        for (row, columns) in [Some(&gauge.region), gauge.from.as_ref()]
            .into_iter()
            .flatten()
            .flat_map(|region| region.spans())
        {
            let left = columns.start.saturating_sub(margin);
            let right = (columns.end + margin).min(width);
            let near = row.saturating_sub(margin)..(row + margin + 1).min(height);
            for seen in &mut window[near] {
                *seen = if seen.start == seen.end {
                    left..right
                } else {
                    seen.start.min(left)..seen.end.max(right)
                };
            }
        }
    }
    window
}
