//! One strip: its rows, through the stages one after the other.

use super::coordinates::TaughtCoordinates;
use super::counts::Counts;
use super::deviation::SquareNoise;
use super::height::HeightRow;
use super::pose::PoseField;
use super::recent::RecentRows;
use super::squares::Squares;
use super::{Input, Maps, Production};
use crate::inspect::align::{Alignment, Sample};
use crate::pipeline::{NO_OFFSET, PhaseMap};
use alloc::vec::Vec;
use core::ops::Range;

/// A strip of rows: the state of each stage, and what it found.
#[derive(Debug)]
pub(super) struct Strip {
    rows: Range<usize>,
    /// Of the row that it works on.
    decoded: PhaseMap,
    heights: HeightRow,
    coordinates: TaughtCoordinates,
    recent: RecentRows,
    pub counts: Counts,
    pub squares: Squares,
    /// Points that the part's motion is found from.
    pub samples: Vec<Sample>,
}

impl Strip {
    /// Of these rows.
    pub fn new(plan: &Production, rows: Range<usize>) -> Self {
        let width = plan.size().0;
        Self {
            decoded: PhaseMap::new(width, 1),
            heights: HeightRow::new(width),
            coordinates: TaughtCoordinates::new(width),
            recent: RecentRows::new(width, plan.gauges.largest_side()),
            counts: Counts::new(plan),
            squares: Squares::new(plan, &rows),
            samples: Vec::new(),
            rows,
        }
    }

    /// Inspects its rows, and those above and below that its squares reach into; `maps` get its own
    /// rows.
    pub fn inspect(
        &mut self,
        plan: &Production,
        pose: &PoseField,
        input: Input<'_>,
        mut maps: Maps<'_>,
    ) {
        self.recent.overflow = None;
        self.counts.clear();
        self.squares.clear();
        let width = plan.size().0;
        let halo = plan.gauges.largest_side().map_or(0, |side| side / 2);
        let rows = self.rows.start.saturating_sub(halo)..self.rows.end + halo;
        let written = rows.start..plan.window.len();
        for v in rows {
            if written.contains(&v) {
                let columns = plan.window[v].clone();
                self.measure(plan, input, v, columns.clone());
                self.align(plan, pose, v, columns);
                if self.rows.contains(&v) {
                    let measured = (&self.decoded, &self.heights);
                    let aligned = (&self.coordinates, self.recent.extent(v));
                    self.counts.add(plan, pose, v, measured, aligned);
                    if let Some(heights) = &mut maps.heights {
                        let row = (v - self.rows.start) * width;
                        self.heights.store(plan, v, &mut heights[row..row + width]);
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
            self.squares.slide(plan, pose, v, &self.recent, rows);
        }
    }

    /// Stages 1 and 2 of columns of row `v`.
    fn measure(&mut self, plan: &Production, input: Input<'_>, v: usize, columns: Range<usize>) {
        if !columns.is_empty() {
            plan.decode(input, v, columns.clone(), &mut self.decoded);
        }
        let (decoded, recent) = (&mut self.decoded, &mut self.recent);
        self.heights.find(plan, decoded, v, columns, recent);
    }

    /// Stage 3 of columns of row `v`.
    fn align(&mut self, plan: &Production, pose: &PoseField, v: usize, columns: Range<usize>) {
        let rows = (&self.heights, &mut self.recent);
        self.coordinates.align(plan, pose, v, columns, rows);
    }

    /// Keeps the points of its rows that the part's motion is found from.
    pub fn sample(&mut self, plan: &Production, alignment: &Alignment, input: Input<'_>) {
        self.samples.clear();
        // The windows of a pair's spots share pixels where the spots are dense.
        let share = libm::sqrt(plan.spot_variance()) * 1e-6;
        let (first, spots) = alignment.spots(self.rows.clone());
        let mut at = first;
        for row in spots.chunk_by(|a, b| a.v == b.v) {
            let (v, columns) = (row[0].v, row[0].u..row[row.len() - 1].u + 1);
            self.measure(plan, input, v, columns);
            for spot in row {
                let offset = self.heights.offset[spot.u];
                if offset != NO_OFFSET {
                    let slope = plan.slope((spot.u, v), self.decoded.phase[spot.u]);
                    let modulation = self.decoded.modulation[spot.u];
                    let above = f64::from(offset) * 1e-6;
                    self.samples.push(Sample {
                        point: plan.triangulator.higher(spot.point, above),
                        sigma: plan.sigma_nm(modulation, slope) * share,
                        over: Some((at, above)),
                    });
                }
                at += 1;
            }
        }
    }

    /// Adds the pixels of row `v` inside `columns` to the noise of a square.
    pub fn add_noise(
        &mut self,
        plan: &Production,
        pose: &PoseField,
        input: Input<'_>,
        v: usize,
        columns: Range<usize>,
        noise: &mut SquareNoise,
    ) {
        self.measure(plan, input, v, columns.clone());
        self.align(plan, pose, v, columns.clone());
        self.coordinates
            .find(plan, pose, v, columns.clone(), &self.heights);
        let deviation = self.recent.row(v);
        for u in columns {
            if deviation[u] != NO_OFFSET {
                let slope = plan.slope((u, v), self.decoded.phase[u]);
                let factor = self.coordinates.factor(plan, u);
                let sigma = plan.sigma_nm(self.decoded.modulation[u], slope);
                let lift = noise.is_sampled(u, v).then(|| {
                    let offset = self.heights.offset[u];
                    plan.lift(pose.placed.as_ref()?, (u, v), offset)
                });
                noise.add(factor, sigma * 1e-6, lift.flatten());
            }
        }
    }
}
