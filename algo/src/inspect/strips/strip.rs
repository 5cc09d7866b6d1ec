//! One strip of rows: its buffers, and the walk down its rows.

use super::coordinates::{Seen, Spots};
use super::counts::{TRUSTS, count_known, count_trusts, slide};
use super::coverage::add_coins;
use super::pose::Stance;
use super::squares::extreme::{Extreme, SquareRow};
use super::squares::narrow::{MAX_TAME, Squares};
use super::{Light, Measure, Production};
use crate::inspect::align::Sample;
use crate::inspect::gauge::Sum;
use crate::phase::{PhaseRow, Trust};
use crate::pipeline::{
    NO_RISE, Risen, RowTally, Seen as Decoded, VARIANCE_UNIT_NM, rise_row, weigh_row,
};
use crate::units::{AbsolutePhase, Height, Modulation};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// A strip of rows, with room for all that it needs and what it found.
#[derive(Debug)]
pub(super) struct Strip {
    rows: Range<usize>,
    pub(super) width: usize,
    /// The row that is being worked on.
    pub(super) phase: Vec<AbsolutePhase>,
    pub(super) modulation: Vec<Modulation>,
    trust: Vec<Trust>,
    pub(super) rise: Vec<i32>,
    /// Deviations of the last rows, the place of row v is v modulo their number.
    recent: Vec<i32>,
    kept: usize,
    /// The columns of these rows outside of which there are none.
    extents: Vec<Range<usize>>,
    /// A row without any.
    none: Vec<i32>,
    /// For each smoothing the packed sums down the columns, with half a side of padding at both ends.
    sums: Vec<Vec<i64>>,
    /// Sums over squares of the row that is being worked on.
    squares: Squares,
    /// Where the pixels of the row lie on the part as taught.
    spots: Spots,
    /// Points that the part's motion is found from.
    pub(super) samples: Vec<Sample>,
    /// The last row with a rise that sums over squares may not hold.
    wild: Option<usize>,
    pub(super) found: Found,
}

/// What a strip found.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    pub tally: RowTally,
    /// Pixels of each trust.
    pub trusts: [u64; TRUSTS],
    /// Heights that were solved exactly.
    pub exact: u64,
    /// Per gauge: pixels with a height.
    pub covered: Vec<u64>,
    /// Per gauge: Σ of what its pixels' coins count.
    pub coins: Vec<u64>,
    /// Per gauge: the square of largest deviation.
    pub extremes: Vec<Option<Extreme>>,
    /// Per patch: its cells.
    pub cells: Vec<Vec<Sum>>,
}

impl Strip {
    pub(super) fn new(plan: &Production, rows: Range<usize>) -> Self {
        let width = plan.rises.surface().width;
        let kept = plan.sides.iter().max().map_or(1, |side| side / 2 * 2 + 2);
        Self {
            rows,
            width,
            phase: vec![AbsolutePhase::UNKNOWN; width],
            modulation: vec![Modulation::default(); width],
            trust: vec![Trust::default(); width],
            rise: vec![NO_RISE; width],
            recent: vec![NO_RISE; width * kept],
            kept,
            extents: vec![0..0; kept],
            none: vec![NO_RISE; width],
            sums: plan
                .sides
                .iter()
                .map(|side| vec![0; width + side / 2 * 2])
                .collect(),
            squares: Squares::new(width + kept),
            spots: Spots::new(width),
            samples: Vec::new(),
            wild: None,
            found: Found {
                covered: vec![0; plan.gauges.len()],
                coins: vec![0; plan.gauges.len()],
                extremes: vec![None; plan.gauges.len()],
                cells: plan
                    .patches
                    .iter()
                    .map(|patch| vec![Sum::default(); patch.grid.len()])
                    .collect(),
                ..Found::default()
            },
        }
    }

    /// Its rows.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Inspects its rows; `heights` is z of them in mm.
    pub(super) fn inspect(
        &mut self,
        plan: &Production,
        stance: &Stance,
        light: Light<'_>,
        mut heights: Option<&mut [f32]>,
    ) {
        self.clear();
        let halo = plan.sides.iter().max().map_or(0, |side| side / 2);
        let bottom = plan.window.len();
        let first = self.rows.start.saturating_sub(halo);
        for v in first..self.rows.end + halo {
            let own = self.rows.contains(&v);
            if v < bottom {
                let mut tally = RowTally::default();
                let columns = plan.window[v].clone();
                let exact = self.row(plan, light, v, columns.clone(), &mut tally);
                self.settle(plan, stance, v, columns);
                if own {
                    self.count(plan, stance, v, &tally, exact);
                    if let Some(heights) = &mut heights {
                        let row = (v - self.rows.start) * self.width;
                        self.store(plan, v, &mut heights[row..row + self.width]);
                    }
                }
                self.weigh(plan, v);
            }
            self.smooth(plan, stance, v, first);
        }
    }

    /// Works out where the pixels of row `v`, which has just been worked on, lie on the part as taught.
    fn settle(&mut self, plan: &Production, stance: &Stance, v: usize, columns: Range<usize>) {
        if stance.placed.is_none() {
            if !plan.patches.is_empty() || plan.weighted.is_some() {
                self.spots.stay(v, columns);
            }
            return;
        }
        let place = v % self.kept * self.width;
        let seen = Seen {
            plan,
            stance,
            v,
            columns: common(&columns, &self.extents[v % self.kept]),
            rise: &self.rise,
        };
        let deviation = &mut self.recent[place..place + self.width];
        if self.spots.find(&seen, deviation) {
            self.wild = Some(v);
        }
    }

    /// Weighs the deviations of row `v`, which has been counted.
    fn weigh(&mut self, plan: &Production, v: usize) {
        let row = v % self.kept;
        let deviation = &mut self.recent[row * self.width..(row + 1) * self.width];
        let span = self.extents[row].clone();
        self.spots.weigh(plan, deviation, span);
    }

    fn clear(&mut self) {
        self.wild = None;
        for sums in &mut self.sums {
            sums.fill(0);
        }
        let found = &mut self.found;
        found.tally = RowTally::default();
        found.trusts = [0; TRUSTS];
        found.exact = 0;
        found.covered.fill(0);
        found.coins.fill(0);
        for cells in &mut found.cells {
            cells.fill(Sum::default());
        }
        found.extremes.fill(None);
    }

    /// Decodes columns of row `v` and finds their rises; the number of those that took an exact solution.
    pub(super) fn row(
        &mut self,
        plan: &Production,
        light: Light<'_>,
        v: usize,
        columns: Range<usize>,
        tally: &mut RowTally,
    ) -> u64 {
        let place = v % self.kept * self.width;
        let deviation = &mut self.recent[place..place + self.width];
        for row in [&mut *deviation, &mut self.rise] {
            row[..columns.start].fill(NO_RISE);
            row[columns.end..].fill(NO_RISE);
        }
        let extent = &mut self.extents[v % self.kept];
        *extent = 0..0;
        if columns.is_empty() {
            return 0;
        }
        let out = PhaseRow {
            phase: &mut self.phase,
            modulation: &mut self.modulation,
            trust: &mut self.trust,
        };
        plan.decode(light, v, columns.clone(), out);
        let row = v * self.width..(v + 1) * self.width;
        let seen = Decoded {
            phase: &self.phase,
            modulation: &self.modulation,
            trust: &self.trust,
            taught: &plan.taught.pixels[row],
            noise: plan.noise,
        };
        let risen = Risen {
            rise: &mut self.rise,
            deviation,
            tally,
            extent,
        };
        let backend = plan.decoder.backend();
        let mut rises = plan.rises.row(v);
        let map = plan.map_row(v);
        if !map.is_empty() {
            // The same wherever a pixel can be resolved, and in the cache.
            rises.base = map;
        }
        rise_row(backend, rises, seen, columns.clone(), risen);
        if weighed(v) {
            let spread = self.extents[v % self.kept].clone();
            weigh_row(backend, rises, seen, spread, &self.rise, tally);
        }
        if tally.resolved == tally.measured {
            return 0;
        }
        self.solve(plan, v, columns, tally)
    }

    /// Solves what the cubics do not reach; how many pixels that were.
    fn solve(
        &mut self,
        plan: &Production,
        v: usize,
        columns: Range<usize>,
        tally: &mut RowTally,
    ) -> u64 {
        let mut exact = 0;
        let recent = v % self.kept * self.width;
        for u in columns {
            if self.trust[u] != Trust::Resolved || self.rise[u] != NO_RISE {
                continue;
            }
            exact += 1;
            let place = v * self.width + u;
            let Some(solution) = plan.solve((u, v), self.phase[u]) else {
                self.trust[u] = Trust::OutOfRange;
                tally.resolved -= 1;
                continue;
            };
            let base = plan.rises.surface().height[place];
            let base = if base.is_known() { base.nm() } else { 0 };
            let height = Height::from_mm(solution.point.z).nm();
            // One above the value for "unknown".
            let rise = height.saturating_sub(base).max(NO_RISE + 1);
            if rise.unsigned_abs() > MAX_TAME {
                self.wild = Some(v);
            }
            self.rise[u] = rise;
            tally.measured += 1;
            let compared = plan.taught.compared(place);
            if compared {
                self.recent[recent + u] = rise;
                tally.compared += 1;
            }
            if weighed(v) {
                let taught = u64::from(plan.taught.sigma(place));
                tally.taught += u64::from(taught != 0);
                tally.taught_variance += (taught * taught + 128) >> 8;
            }
            if weighed(v) && compared {
                tally.weighed += 1;
                let sigma = plan.sigma_nm(self.modulation[u], 1.0 / solution.slope);
                let units = sigma / VARIANCE_UNIT_NM;
                tally.variance += libm::rint((units * units).min(4_000_000.0)) as u64;
            }
        }
        exact
    }

    fn count(
        &mut self,
        plan: &Production,
        stance: &Stance,
        v: usize,
        tally: &RowTally,
        exact: u64,
    ) {
        let backend = plan.decoder.backend();
        let found = &mut self.found;
        found.tally.add(tally);
        found.exact += exact;
        let seen = &self.trust[plan.window[v].clone()];
        count_trusts(backend, seen, &mut found.trusts);
        let extent = &self.extents[v % self.kept];
        for (at, gauge) in plan.gauges.iter().enumerate() {
            if gauge.measure != Measure::Coverage {
                continue;
            }
            for (_, columns) in stance.region(plan, at).row(v) {
                let span = common(columns, extent);
                let (rises, modulations) = (&self.rise[span.clone()], &self.modulation[span]);
                count_known(backend, rises, &mut found.covered[at]);
                let coins = &mut found.coins[at];
                add_coins(backend, &plan.threshold, rises, modulations, coins);
            }
        }
        let place = v % self.kept * self.width;
        let deviation = &self.recent[place..place + self.width];
        for (patch, cells) in plan.patches.iter().zip(&mut found.cells) {
            for (_, columns) in stance.region(plan, patch.region).row(v) {
                let span = common(columns, extent);
                self.spots.gather(&patch.grid, deviation, span, cells);
            }
        }
    }

    /// Writes the heights of row `v`, which has just been worked on.
    fn store(&self, plan: &Production, v: usize, heights: &mut [f32]) {
        let bases = &plan.rises.surface().height[v * self.width..];
        for ((mm, &rise), base) in heights.iter_mut().zip(&self.rise).zip(bases) {
            let base = if base.is_known() { base.nm() } else { 0 };
            *mm = if rise == NO_RISE {
                f32::NAN
            } else {
                ((f64::from(base) + f64::from(rise)) / 1e6) as f32
            };
        }
    }

    /// Slides the sums of each smoothing down to row `v`, and looks at the squares that are complete with it. `first` is
    /// the first row that was worked on.
    fn smooth(&mut self, plan: &Production, stance: &Stance, v: usize, first: usize) {
        let backend = plan.decoder.backend();
        let row = |v: usize| v % self.kept * self.width..(v % self.kept + 1) * self.width;
        let known = |v: usize| match v >= first && v < plan.window.len() {
            true => (&self.recent[row(v)], self.extents[v % self.kept].clone()),
            false => (&self.none[..], 0..0),
        };
        for (&side, sums) in plan.sides.iter().zip(&mut self.sums) {
            let half = side / 2;
            let (new, entering) = known(v);
            let (old, leaving) = match v.checked_sub(2 * half + 1) {
                Some(old) => known(old),
                None => (&self.none[..], 0..0),
            };
            let changed = hull(entering, leaving);
            let inside = &mut sums[half + changed.start..half + changed.end];
            slide(backend, inside, &new[changed.clone()], &old[changed]);
            let seen = (v.saturating_sub(2 * half)..=v)
                .map(|v| known(v).1)
                .fold(0..0, hull);
            let Some(centre) = v.checked_sub(half).filter(|v| self.rows.contains(v)) else {
                continue;
            };
            let centres = &self.recent[row(centre)];
            let wild = self.wild.is_some_and(|wild| wild + 2 * half >= v);
            let tame = !wild && Squares::hold(side);
            if tame {
                self.squares.add(backend, sums, side, seen.clone());
            }
            let gauges = plan.gauges.iter().zip(&mut self.found.extremes);
            for (at, (gauge, best)) in gauges.enumerate() {
                if gauge.measure == (Measure::Deviation { side }) {
                    for (_, span) in stance.region(plan, at).row(centre) {
                        let span = common(span, &seen);
                        let row = SquareRow {
                            sums,
                            centres,
                            side,
                            row: centre,
                        };
                        if tame {
                            self.squares.search(backend, best, &row, span);
                        } else {
                            row.search(best, span);
                        }
                    }
                }
            }
        }
    }

    /// Σ of the variances of the weighted deviations of row `v` inside `columns`, nm².
    pub(super) fn variance(
        &mut self,
        plan: &Production,
        stance: &Stance,
        light: Light<'_>,
        v: usize,
        columns: Range<usize>,
    ) -> f64 {
        let mut tally = RowTally::default();
        self.row(plan, light, v, columns.clone(), &mut tally);
        self.settle(plan, stance, v, columns.clone());
        let mut sum = 0.0;
        for u in columns {
            if self.recent[v % self.kept * self.width + u] != NO_RISE {
                let slope = plan.slope((u, v), self.phase[u]);
                let share = self.spots.weight(plan, u).share();
                let measured = plan.sigma_nm(self.modulation[u], slope) * share;
                sum += measured * measured;
            }
        }
        sum
    }
}

/// Every so many rows the variances of the heights are summed: their mean needs no more.
const WEIGHED: usize = 4;

/// Whether the variances of a row are summed.
fn weighed(v: usize) -> bool {
    v.is_multiple_of(WEIGHED)
}

/// The columns of both, possibly none.
fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// The columns from the first to the last of either.
fn hull(a: Range<usize>, b: Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b,
        (_, true) => a,
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}
