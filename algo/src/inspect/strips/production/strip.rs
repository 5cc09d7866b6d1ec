//! The strips of a frame, each of which takes its rows through the stages one after the other, and
//! the maps that people ask for.

use super::plan::Production;
use crate::inspect::align::{Alignment, Coarse, Equations, HeightSample};
use crate::inspect::strips::accumulate::squares::extreme::Extreme;
use crate::inspect::strips::accumulate::{SectionSight, StripSums};
use crate::inspect::strips::align::{Comparison, PoseField, TaughtCoordinates};
use crate::inspect::strips::measure::{HeightRow, Input, RecentRows};
use crate::inspect::strips::readings::{ContourFit, PartFeatures, SquareNoise};
use crate::math::common;
use crate::pipeline::{NO_OFFSET, PhaseMap};
use alloc::vec::Vec;
use core::ops::Range;

/// The strips of a frame, with the buffers of an inspection. Reused from cycle to cycle, so that a
/// cycle allocates nothing.
#[derive(Debug)]
pub struct Strips {
    pub(super) strips: Vec<Strip>,
    /// What the rows of each add up to.
    pub(super) sums: Vec<StripSums>,
    /// Rows of each strip; the last may have fewer.
    pub(super) rows: usize,
    pub(super) pose: PoseField,
    /// Points of all strips that the part's motion is found from.
    pub(super) samples: Vec<HeightSample>,
    pub(super) fitting: Equations,
    /// The picture without fringes, from fine to coarse.
    pub(super) pictures: Vec<Coarse>,
    /// One per contour that the part is placed by.
    pub(super) anchors: Vec<ContourFit>,
    /// What pixels see of each section that a gauge needs.
    pub(super) sights: Vec<SectionSight>,
    pub(super) features: PartFeatures,
}

impl Strips {
    /// Bytes of the cells of gauges and of the places of their largest deviations: nearly all of
    /// the memory that grows with the gauges.
    pub fn bytes(&self) -> usize {
        self.sums.iter().map(StripSums::bytes).sum::<usize>() + self.pose.bytes()
    }
}

/// Maps that an inspection writes, each as long as a frame, row-major, NaN where there is no value.
#[derive(Debug, Default)]
pub struct Maps<'a> {
    /// z in mm of each pixel with a height, as the part lies.
    pub heights: Option<&'a mut [f32]>,
    /// σ_z in mm of each pixel with a height: its noise, without the uncertainty of models.
    pub sigma: Option<&'a mut [f32]>,
    /// Deviation from golden along its normal in mm of each pixel that is compared, as the squares
    /// of a gauge get it: the part's motion taken back, times golden's weight.
    pub deviation: Option<&'a mut [f32]>,
}

impl<'a> Maps<'a> {
    /// Whether nothing is to be written.
    pub(super) fn is_empty(&self) -> bool {
        self.heights.is_none() && self.sigma.is_none() && self.deviation.is_none()
    }

    /// Those of one part of the frame after the other, of so many pixels each.
    pub(super) fn split(self, pixels: usize) -> impl Iterator<Item = Self> {
        let parts = |map: Option<&'a mut [f32]>| map.map(|map| map.chunks_mut(pixels));
        let (mut heights, mut sigma) = (parts(self.heights), parts(self.sigma));
        let mut deviation = parts(self.deviation);
        core::iter::from_fn(move || {
            let maps = Self {
                heights: heights.as_mut().and_then(Iterator::next),
                sigma: sigma.as_mut().and_then(Iterator::next),
                deviation: deviation.as_mut().and_then(Iterator::next),
            };
            (!maps.is_empty()).then_some(maps)
        })
    }
}

/// A strip of rows: the state of each stage.
#[derive(Debug)]
pub struct Strip {
    rows: Range<usize>,
    /// Of the row that it works on.
    decoded: PhaseMap,
    heights: HeightRow,
    coordinates: TaughtCoordinates,
    recent: RecentRows,
    /// Points that the part's motion is found from.
    pub samples: Vec<HeightSample>,
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
            samples: Vec::new(),
            rows,
        }
    }

    /// Inspects its rows, and those above and below that its squares reach into; `sums` are theirs,
    /// and `maps` get its own rows.
    pub fn inspect(
        &mut self,
        plan: &Production,
        (pose, sights): (&PoseField, &[SectionSight]),
        input: Input<'_>,
        sums: &mut StripSums,
        mut maps: Maps<'_>,
    ) {
        sums.clear();
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
                    sums.counts.add(with, gauges, v, measured, aligned);
                    let with = (golden, &plan.phase, gauges);
                    sums.sections
                        .add(with, &plan.sections, (pose, sights), v, measured);
                    if let Some(heights) = &mut maps.heights {
                        let row = (v - self.rows.start) * width;
                        self.heights
                            .store(golden, v, &mut heights[row..row + width]);
                    }
                    if let Some(sigma) = &mut maps.sigma {
                        let row = (v - self.rows.start) * width;
                        self.store_sigma(plan, v, &mut sigma[row..row + width]);
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
            sums.squares.slide(with, gauges, v, &self.recent, rows);
        }
    }

    /// Writes σ_z of row `v`, which was measured last, in mm; NaN where there is no height.
    fn store_sigma(&self, plan: &Production, v: usize, sigma: &mut [f32]) {
        // From the noise of independent pixels to that of the map.
        let windows = libm::sqrt(plan.readings.budget.square_variance(1)) * 1e-6;
        for (u, mm) in sigma.iter_mut().enumerate() {
            *mm = if self.heights.offset[u] == NO_OFFSET {
                f32::NAN
            } else {
                let slope = plan.golden.slope((u, v), self.decoded.phase[u]);
                let nm = plan.phase.sigma_nm(self.decoded.modulation[u], slope);
                (nm * windows) as f32
            };
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
        let share = libm::sqrt(plan.readings.budget.spot_variance()) * 1e-6;
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
                    self.samples.push(HeightSample {
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
        (square, side): (&Extreme, usize),
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
