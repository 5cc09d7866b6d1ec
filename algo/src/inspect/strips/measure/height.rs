//! Stage 2, height: absolute phase → height offset, how far each pixel lies above the golden
//! surface on its own ray.
//!
//! A cubic per pixel gives the offset ([`HeightCubics`](crate::pipeline::HeightCubics)). What it does not reach is what
//! the part lies on ([`Ground`](crate::inspect::strips::golden::ground::Ground)), or is triangulated exactly.

use super::decode::PhasePlan;
use crate::frame::SampleNoise;
use crate::inspect::strips::golden::{Golden, NodeRow, base_nm};
use crate::phase::Trust;
use crate::pipeline::{
    CubicInput, CubicOutput, HeightTally, NO_OFFSET, PhaseMap, VARIANCE_UNIT_NM, offset_row,
    sum_variances,
};
use crate::units::Height;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// The heights of the row that a strip works on.
#[derive(Debug)]
pub struct HeightRow {
    /// z − z₀ in nm; [`NO_OFFSET`] where there is no height.
    pub offset: Vec<i32>,
    /// Counts and variances of the row.
    pub tally: HeightTally,
    /// How many heights were triangulated exactly.
    pub exact: u64,
    ground: NodeRow<4>,
}

/// Variances are summed in every so many rows: their mean needs no more.
const VARIANCE_ROWS: usize = 4;
/// The largest variance that is summed, (1 mm)², in units of [`VARIANCE_UNIT_NM`]².
const MAX_VARIANCE: f64 = 4_000_000.0;

impl HeightRow {
    /// Of `width` pixels.
    pub fn new(width: usize) -> Self {
        Self {
            offset: vec![NO_OFFSET; width],
            tally: HeightTally::default(),
            exact: 0,
            ground: NodeRow::new(),
        }
    }

    /// Finds the heights of columns of row `v`, which has just been decoded. Where the part is
    /// compared, the offset is the deviation of a part that lies as taught.
    pub fn find(
        &mut self,
        golden: &Golden,
        phase: &PhasePlan,
        decoded: &mut PhaseMap,
        v: usize,
        columns: Range<usize>,
        recent: &mut RecentRows,
    ) {
        (self.tally, self.exact) = (HeightTally::default(), 0);
        let (deviation, extent) = recent.row_mut(v);
        for row in [&mut *deviation, &mut self.offset] {
            row[..columns.start].fill(NO_OFFSET);
            row[columns.end..].fill(NO_OFFSET);
        }
        *extent = 0..0;
        if columns.is_empty() {
            return;
        }
        let width = self.offset.len();
        let input = CubicInput {
            phase: &decoded.phase,
            modulation: &decoded.modulation,
            trust: &decoded.trust,
            taught: golden.taught.row(v, width),
            noise: phase.variance_scale,
        };
        let output = CubicOutput {
            offset: &mut self.offset,
            deviation,
            tally: &mut self.tally,
            extent,
        };
        let backend = phase.decoder.backend();
        let mut cubics = golden.cubics.row(v);
        let map = phase.map_row(golden, v);
        if !map.is_empty() {
            // Golden's phase by this sequence, and already in the cache.
            cubics.base = map;
        }
        offset_row(backend, cubics, input, columns.clone(), output);
        if sums_variances(v) {
            let extent = recent.extent(v);
            sum_variances(
                backend,
                cubics,
                input,
                extent,
                &self.offset,
                &mut self.tally,
            );
        }
        if self.tally.resolved != self.tally.measured {
            self.triangulate(golden, phase, decoded, v, columns, recent);
        }
    }

    /// Triangulates what the cubics do not reach.
    fn triangulate(
        &mut self,
        golden: &Golden,
        phase: &PhasePlan,
        decoded: &mut PhaseMap,
        v: usize,
        columns: Range<usize>,
        recent: &mut RecentRows,
    ) {
        let Self {
            offset,
            tally,
            exact,
            ground: nodes,
        } = self;
        let width = offset.len();
        if let Some(ground) = &golden.ground {
            ground.take_row(v, nodes);
        }
        for u in columns {
            if decoded.trust[u] != Trust::Resolved || offset[u] != NO_OFFSET {
                continue;
            }
            let (place, seen) = (v * width + u, decoded.phase[u]);
            let compared = golden.taught.compared(place);
            let ground = golden.ground.as_ref().filter(|_| !compared);
            let on_ground = ground.and_then(|ground| ground.height(nodes, u, seen));
            let exactly = || {
                let solution = golden.solve((u, v), seen)?;
                Some((solution.point.z, solution.slope))
            };
            *exact += u64::from(on_ground.is_none());
            // Slopes are asked for where a pixel is compared.
            let found = on_ground.map(|z| (z, f64::INFINITY)).or_else(exactly);
            let Some((z, slope)) = found else {
                decoded.trust[u] = Trust::OutOfRange;
                tally.resolved -= 1;
                continue;
            };
            let height = Height::from_mm(z).nm();
            // One above the value for "no offset".
            let base = base_nm(golden.cubics.surface().height[place]);
            let nm = height.saturating_sub(base).max(NO_OFFSET + 1);
            offset[u] = nm;
            tally.measured += 1;
            if compared {
                recent.row_mut(v).0[u] = nm;
                tally.compared += 1;
            }
            if sums_variances(v) {
                let taught = u64::from(golden.taught.sigma(place));
                tally.taught += u64::from(taught != 0);
                tally.taught_variance += (taught * taught + 128) >> 8;
            }
            if sums_variances(v) && compared {
                tally.summed += 1;
                let noise = SampleNoise::constant(phase.noise_counts);
                let turns = phase.decoder.phase_noise(decoded.modulation[u], noise);
                let units = turns / slope * 1e6 / VARIANCE_UNIT_NM;
                tally.variance += libm::rint((units * units).min(MAX_VARIANCE)) as u64;
            }
        }
    }

    /// Writes z of row `v`, which was found last, in mm; NaN where there is no height.
    pub fn store(&self, golden: &Golden, v: usize, heights: &mut [f32]) {
        let golden = &golden.cubics.surface().height[v * self.offset.len()..];
        for ((mm, &nm), &golden) in heights.iter_mut().zip(&self.offset).zip(golden) {
            *mm = if nm == NO_OFFSET {
                f32::NAN
            } else {
                ((f64::from(base_nm(golden)) + f64::from(nm)) / 1e6) as f32
            };
        }
    }
}

/// Whether the variances of row `v` are summed.
fn sums_variances(v: usize) -> bool {
    v.is_multiple_of(VARIANCE_ROWS)
}

/// The deviations of the last rows of a strip: as many rows as the largest square spans, and the one
/// that it leaves. A ring: row v lies at v modulo their number.
#[derive(Debug)]
pub struct RecentRows {
    width: usize,
    rows: usize,
    /// Deviations from golden along the normal in nm, weighted; [`NO_OFFSET`] where the part is not
    /// compared.
    deviation: Vec<i32>,
    /// The columns of each row outside of which no pixel is compared.
    extent: Vec<Range<usize>>,
    /// A row in which no pixel is compared.
    empty: Vec<i32>,
}

impl RecentRows {
    /// Rows of `width` pixels for squares of up to `side` pixels.
    pub fn new(width: usize, side: Option<usize>) -> Self {
        let rows = side.map_or(1, |side| side / 2 * 2 + 2);
        Self {
            width,
            rows,
            deviation: vec![NO_OFFSET; width * rows],
            extent: vec![0..0; rows],
            empty: vec![NO_OFFSET; width],
        }
    }

    /// The deviations of row `v`.
    pub fn row(&self, v: usize) -> &[i32] {
        let at = v % self.rows * self.width;
        &self.deviation[at..at + self.width]
    }

    /// The deviations of row `v` and its extent, to be written.
    pub fn row_mut(&mut self, v: usize) -> (&mut [i32], &mut Range<usize>) {
        let at = v % self.rows;
        let row = at * self.width..(at + 1) * self.width;
        (&mut self.deviation[row], &mut self.extent[at])
    }

    /// The columns of row `v` outside of which no pixel is compared.
    pub fn extent(&self, v: usize) -> Range<usize> {
        self.extent[v % self.rows].clone()
    }

    /// Writes the deviations of row `v` in mm; NaN where the part is not compared.
    pub fn store(&self, v: usize, deviation: &mut [f32]) {
        for (mm, &nm) in deviation.iter_mut().zip(self.row(v)) {
            *mm = match nm {
                NO_OFFSET => f32::NAN,
                nm => (f64::from(nm) / 1e6) as f32,
            };
        }
    }

    /// The deviations of row `v` and its extent; an empty row if it is none of the `written` ones.
    pub fn row_of(&self, v: usize, written: &Range<usize>) -> (&[i32], Range<usize>) {
        match written.contains(&v) {
            true => (self.row(v), self.extent(v)),
            false => (&self.empty, 0..0),
        }
    }
}
