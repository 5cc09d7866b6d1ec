//! The part of the frame that some gauge looks at.

use crate::recipe::{GaugeKind, RecipeFile};
use algo::inspect::Region;
use std::ops::Range;

/// The columns of each row that some gauge looks at, its smoothing included: nothing else is
/// computed. `regions` holds one per gauge.
pub(super) fn of(file: &RecipeFile, regions: &[Region]) -> Vec<Range<usize>> {
    let (width, height) = (file.camera.width as usize, file.camera.height as usize);
    let mut window = vec![0..0; height];
    for (gauge, region) in file.gauges.iter().zip(regions) {
        let margin = match gauge.measures {
            GaugeKind::Deviation { smoothing_px } => smoothing_px / 2,
            GaugeKind::Coverage => 0,
        };
        for (row, columns) in region.spans() {
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
