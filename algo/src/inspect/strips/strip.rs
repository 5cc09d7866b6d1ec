//! The strips of a frame, each of which takes its rows through the stages one after the other.

use super::contours::ContourFit;
use super::coordinates::{Comparison, TaughtCoordinates};
use super::counts::Counts;
use super::decode::Input;
use super::deviation::SquareNoise;
use super::fits::Fit;
use super::height::HeightRow;
use super::maps::Maps;
use super::plan::Production;
use super::pose::PoseField;
use super::recent::RecentRows;
use super::sections::{SectionFit, SectionPoints, SectionSight};
use super::spans::common;
use super::squares::Squares;
use super::squares::extreme::Extreme;
use crate::inspect::align::{Alignment, Coarse, FitBuffers, Sample};
use crate::inspect::feature::{Cell, Sum};
use crate::pipeline::{NO_OFFSET, PhaseMap};
use alloc::vec::Vec;
use core::ops::Range;

/// The strips of a frame, with the buffers of an inspection. Reused from cycle to cycle, so that a
/// cycle allocates nothing.
#[derive(Debug)]
pub struct Strips {
    pub(super) strips: Vec<Strip>,
    /// Rows of each strip; the last may have fewer.
    pub(super) rows: usize,
    pub(super) pose: PoseField,
    /// Points of all strips that the part's motion is found from.
    pub(super) samples: Vec<Sample>,
    pub(super) fitting: FitBuffers,
    /// The picture without fringes, from fine to coarse.
    pub(super) pictures: Vec<Coarse>,
    pub(super) cells: CellBuffers,
    /// One per plane that a gauge needs.
    pub(super) fits: Vec<Fit>,
    /// One per contour that a gauge needs, and one per contour that the part is placed by.
    pub(super) contours: Vec<ContourFit>,
    pub(super) anchors: Vec<ContourFit>,
    /// One per section that a gauge needs: what pixels see of it, and what was found.
    pub(super) sights: Vec<SectionSight>,
    pub(super) sections: Vec<SectionFit>,
}

impl Strips {
    /// Bytes of the cells of gauges and of the places of their largest deviations: nearly all of
    /// the memory that grows with the gauges.
    pub fn bytes(&self) -> usize {
        let strips = self.strips.iter();
        let own = strips.map(|strip| strip.counts.bytes() + strip.squares.bytes());
        own.sum::<usize>() + self.pose.bytes()
    }
}

/// Buffers for the cells of one gauge after the other.
#[derive(Debug, Default)]
pub struct CellBuffers {
    pub sums: Vec<Sum>,
    pub cells: Vec<Cell>,
    pub weights: Vec<f64>,
}

/// A strip of rows: the state of each stage, and what it found.
#[derive(Debug)]
pub struct Strip {
    rows: Range<usize>,
    /// Of the row that it works on.
    decoded: PhaseMap,
    heights: HeightRow,
    coordinates: TaughtCoordinates,
    recent: RecentRows,
    pub counts: Counts,
    pub squares: Squares,
    pub sections: SectionPoints,
    /// Points that the part's motion is found from.
    pub samples: Vec<Sample>,
}

impl Strip {
    /// Of these rows.
    pub fn new(plan: &Production, rows: Range<usize>) -> Self {
        let (width, gauges) = (plan.golden.size().0, &plan.gauges);
        Self {
            decoded: PhaseMap::new(width, 1),
            heights: HeightRow::new(width),
            coordinates: TaughtCoordinates::new(width, !gauges.patches.is_empty()),
            recent: RecentRows::new(width, gauges.largest_side()),
            counts: Counts::new(gauges),
            squares: Squares::new(gauges, width, &rows),
            sections: SectionPoints::new(gauges),
            samples: Vec::new(),
            rows,
        }
    }

    /// Inspects its rows, and those above and below that its squares reach into; `maps` get its own
    /// rows.
    pub fn inspect(
        &mut self,
        plan: &Production,
        (pose, sights): (&PoseField, &[SectionSight]),
        input: Input<'_>,
        mut maps: Maps<'_>,
    ) {
        self.counts.clear();
        self.squares.clear();
        self.sections.clear();
        let (golden, gauges) = (&plan.golden, &plan.gauges);
        let with = plan.comparison(pose);
        let width = golden.size().0;
        let halo = gauges.largest_side().map_or(0, |side| side / 2);
        let rows = self.rows.start.saturating_sub(halo)..self.rows.end + halo;
        let written = rows.start..golden.window.len();
        for v in rows {
            if written.contains(&v) {
                let columns = golden.window[v].clone();
                self.measure(plan, input, v, columns.clone());
                self.align(with, v, columns);
                if self.rows.contains(&v) {
                    let measured = (&self.decoded, &self.heights);
                    let aligned = (&self.coordinates, self.recent.extent(v));
                    self.counts.add(with, gauges, v, measured, aligned);
                    self.sections.add(plan, (pose, sights), v, measured);
                    if let Some(heights) = &mut maps.heights {
                        let row = (v - self.rows.start) * width;
                        self.heights
                            .store(golden, v, &mut heights[row..row + width]);
                    }
                }
                if let Some(deviation) = &mut maps.deviation
                    && self.rows.contains(&v)
                {
                    let row = (v - self.rows.start) * width;
                    self.recent.store(v, &mut deviation[row..row + width]);
                }
            }
            let rows = (&self.rows, &written);
            self.squares.slide(with, gauges, v, &self.recent, rows);
        }
    }

    /// Stages 1 and 2 of columns of row `v`.
    fn measure(&mut self, plan: &Production, input: Input<'_>, v: usize, columns: Range<usize>) {
        let (golden, phase) = (&plan.golden, &plan.phase);
        let (decoded, recent) = (&mut self.decoded, &mut self.recent);
        if !columns.is_empty() {
            phase.decode(golden, input, v, columns.clone(), decoded);
        }
        self.heights
            .find(golden, phase, decoded, v, columns, recent);
    }

    /// Stage 3 of columns of row `v`.
    fn align(&mut self, with: Comparison<'_>, v: usize, columns: Range<usize>) {
        let (heights, recent) = (&self.heights, &mut self.recent);
        self.coordinates.align(with, v, columns, heights, recent);
    }

    /// Keeps the points of its rows that the part's motion is found from.
    pub fn sample(&mut self, plan: &Production, alignment: &Alignment, input: Input<'_>) {
        self.samples.clear();
        // The windows of a pair's spots share pixels where the spots are dense.
        let share = libm::sqrt(plan.budget.spot_variance()) * 1e-6;
        let (first, spots) = alignment.spots(self.rows.clone());
        let mut at = first;
        for row in spots.chunk_by(|a, b| a.v == b.v) {
            let (v, columns) = (row[0].v, row[0].u..row[row.len() - 1].u + 1);
            self.measure(plan, input, v, columns);
            for spot in row {
                let offset = self.heights.offset[spot.u];
                if offset != NO_OFFSET {
                    let slope = plan.golden.slope((spot.u, v), self.decoded.phase[spot.u]);
                    let modulation = self.decoded.modulation[spot.u];
                    let above = f64::from(offset) * 1e-6;
                    self.samples.push(Sample {
                        point: plan.golden.triangulator.higher(spot.point, above),
                        sigma: plan.phase.sigma_nm(modulation, slope) * share,
                        over: Some((at, above)),
                    });
                }
                at += 1;
            }
        }
    }

    /// The noise of the pixels of a square of `side` pixels.
    pub fn noise_of(
        &mut self,
        plan: &Production,
        pose: &PoseField,
        input: Input<'_>,
        square: &Extreme,
        side: usize,
    ) -> SquareNoise {
        let (golden, with) = (&plan.golden, plan.comparison(pose));
        let half = side / 2;
        let bottom = (square.row + half + 1).min(golden.window.len());
        let mut noise = SquareNoise::new(side);
        for v in square.row.saturating_sub(half)..bottom {
            let left = square.column.saturating_sub(half);
            let columns = common(&(left..square.column + half + 1), &golden.window[v]);
            if columns.is_empty() {
                continue;
            }
            self.measure(plan, input, v, columns.clone());
            self.align(with, v, columns.clone());
            self.coordinates
                .find(with, v, columns.clone(), &self.heights);
            let deviation = self.recent.row(v);
            for u in columns.filter(|u| deviation[*u] != NO_OFFSET) {
                let slope = golden.slope((u, v), self.decoded.phase[u]);
                let factor = self.coordinates.factor(golden, u);
                let sigma = plan.phase.sigma_nm(self.decoded.modulation[u], slope);
                let lift = noise.is_sampled(u, v).then(|| {
                    let (alignment, placed) = (plan.alignment.as_ref()?, pose.placed.as_ref()?);
                    golden.lift(alignment, placed, (u, v), self.heights.offset[u])
                });
                noise.add(factor, sigma * 1e-6, lift.flatten());
            }
        }
        noise
    }
}
