//! Stage 4, accumulate: what the rows of a strip count: pixels of each trust, heights, coverage,
//! and cells of gauges.

use super::coverage::{add_variances, count_known};
use super::gauges::Gauges;
use crate::inspect::feature::Sum;
use crate::inspect::strips::align::{Comparison, TaughtCoordinates};
use crate::inspect::strips::measure::HeightRow;
use crate::math::common;
use crate::phase::Trust;
use crate::pipeline::{HeightTally, PhaseMap};
use crate::simd::{Lanes, back_end_entry};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Sums over the rows of a strip. Whole numbers, so that the order of summation does not matter.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Heights and their variances.
    pub tally: HeightTally,
    /// Pixels of each trust.
    pub trusts: [u64; TRUSTS],
    /// Heights that were triangulated exactly.
    pub exact: u64,
    /// Per gauge: pixels with a height.
    pub covered: Vec<u64>,
    /// Per gauge: the variance of that number, see [`super::coverage`].
    pub variance: Vec<i64>,
    /// Per patch: its cells.
    pub cells: Vec<Vec<Sum>>,
}

impl Counts {
    pub fn new(gauges: &Gauges) -> Self {
        let cells = gauges.patches.iter();
        Self {
            covered: vec![0; gauges.list.len()],
            variance: vec![0; gauges.list.len()],
            cells: cells
                .map(|patch| vec![Sum::default(); patch.grid.len()])
                .collect(),
            ..Self::default()
        }
    }

    /// Bytes of its cells.
    pub fn bytes(&self) -> usize {
        self.cells.iter().map(|cells| size_of_val(&**cells)).sum()
    }

    pub fn clear(&mut self) {
        self.tally = HeightTally::default();
        self.trusts = [0; TRUSTS];
        self.exact = 0;
        self.covered.fill(0);
        self.variance.fill(0);
        for cells in &mut self.cells {
            cells.fill(Sum::default());
        }
    }

    /// Adds row `v`, which was aligned last.
    pub fn add(
        &mut self,
        with: Comparison<'_>,
        gauges: &Gauges,
        v: usize,
        (decoded, heights): (&PhaseMap, &HeightRow),
        (coordinates, extent): (&TaughtCoordinates, Range<usize>),
    ) {
        let Comparison {
            backend,
            golden,
            pose,
        } = with;
        self.tally.add(&heights.tally);
        self.exact += heights.exact;
        let trusts = &decoded.trust[golden.window[v].clone()];
        count_trusts(backend, trusts, &mut self.trusts);
        for &at in &gauges.coverages {
            let Some(region) = gauges.region(pose, at) else {
                continue;
            };
            for (_, columns) in region.row(v) {
                let span = common(columns, &extent);
                let offsets = &heights.offset[span.clone()];
                let modulations = &decoded.modulation[span];
                let (threshold, variance) = (&gauges.threshold, &mut self.variance[at]);
                count_known(backend, threshold, offsets, &mut self.covered[at]);
                add_variances(backend, threshold, offsets, modulations, variance);
            }
        }
        for (patch, cells) in gauges.patches.iter().zip(&mut self.cells) {
            for (_, columns) in pose.region(&gauges.regions, patch.feature).row(v) {
                let span = common(columns, &extent);
                coordinates.add_to_cells(&patch.grid, span, cells);
            }
        }
    }
}

/// Number of trusts.
pub const TRUSTS: usize = Trust::REASONS.len() + 1;
/// All of them, the frequent ones first.
const ORDER: [Trust; TRUSTS] = [
    Trust::Resolved,
    Trust::Unexpected,
    Trust::Dark,
    Trust::LowModulation,
    Trust::Saturated,
    Trust::Residual,
    Trust::OutOfRange,
    Trust::LightEdge,
];
/// Pixels whose counts fit into a byte.
const BLOCK: usize = 255;

back_end_entry! {
    /// Adds the number of pixels with each trust to `counts`.
    fn count_trusts [] = trusts(row: &[Trust], counts: &mut [u64; TRUSTS])
}

#[inline(always)]
fn trusts<V: Lanes>(_: V, row: &[Trust], counts: &mut [u64; TRUSTS]) {
    for block in row.chunks(BLOCK) {
        let mut left = block.len() as u64;
        for trust in ORDER {
            // Most blocks have only the first ones: it ends when all pixels are counted.
            if left == 0 {
                break;
            }
            let mut here = 0_u8;
            for &seen in block {
                here = here.wrapping_add(u8::from(seen as u8 == trust as u8));
            }
            counts[trust as usize] += u64::from(here);
            left -= u64::from(here);
        }
    }
}
