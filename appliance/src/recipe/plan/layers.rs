//! Maps of a measured part for the page (height, deviation from golden, modulation), and its point
//! cloud.

use super::inspect::Laps;
use super::taught::pitch;
use super::{Plan, STRIPS};
use crate::head::calibration::Calibration;
use crate::head::seam;
use crate::output::cloud::{Axes, Pixels, ply};
use crate::recipe::{Recipe, Refusal};
use crate::station::Square;
use algo::geometry::{HeightRange, Triangulator};
use algo::inspect::{Drawing, Findings, Maps};
use algo::pipeline;
use algo::units::{Height, Modulation};
use hal::frame::Frame;
use serde::Serialize;
use std::sync::{Arc, PoisonError};

/// Maps of one part, row-major.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Pixels per row.
    pub width: usize,
    /// z in mm as the part lies, NaN where not resolved.
    pub height_mm: Vec<f32>,
    /// σ_z in mm: the noise of [`Self::height_mm`].
    pub sigma_mm: Vec<f32>,
    /// Deviation from golden in mm as [`Self::shown`] says, NaN where the part is not compared.
    pub deviation_mm: Vec<f32>,
    /// Which deviation the map shows.
    pub shown: ShownDeviation,
    /// Modulation of the finest level in counts.
    pub modulation: Vec<f32>,
    /// Counts of a full sample.
    full_scale: u16,
    triangulator: Arc<Triangulator>,
}

impl Layers {
    /// x, y and z in mm of every `stride`-th pixel, NaN where not resolved.
    pub fn points(&self, stride: usize) -> [Vec<f32>; 3] {
        points(&self.triangulator, (&self.height_mm, self.width), stride)
    }

    /// The point cloud of the part as binary PLY, with its modulation as intensity.
    pub fn cloud(&self, pixels: Pixels) -> Vec<u8> {
        // NaN becomes an unknown height.
        let heights = self.height_mm.iter();
        let heights = heights.map(|&mm| Height::from_mm(f64::from(mm)));
        let shade = |at: usize| {
            let intensity = self.modulation[at] * 2.0 / f32::from(self.full_scale) * 255.0;
            (intensity as u8, self.sigma_mm[at])
        };
        let form = (Axes::World, pixels);
        ply(&self.triangulator, form, self.width, heights, shade)
    }
}

/// x, y and z in mm of every `stride`-th pixel of heights of `width` columns, NaN where not known.
fn points(
    triangulator: &Triangulator,
    (height_mm, width): (&[f32], usize),
    stride: usize,
) -> [Vec<f32>; 3] {
    let room = height_mm.len() / (stride * stride) + width + 1;
    let mut all = [(); 3].map(|()| Vec::with_capacity(room));
    for (v, row) in height_mm.chunks(width.max(1)).enumerate().step_by(stride) {
        for (u, &mm) in row.iter().enumerate().step_by(stride) {
            let height = (!mm.is_nan()).then(|| Height::from_mm(f64::from(mm)));
            let point = height.and_then(|height| triangulator.point(u, v, height));
            let point = point.map_or([f32::NAN; 3], |at| [at.x, at.y, at.z].map(|mm| mm as f32));
            for (plane, mm) in all.iter_mut().zip(point) {
                plane.push(mm);
            }
        }
    }
    all
}

/// Golden as it is looked at.
#[derive(Debug)]
pub struct GoldenView(Triangulator);

impl GoldenView {
    /// Of a recipe, with the models that it was taught with.
    ///
    /// # Errors
    /// In words: they are none.
    pub fn new(recipe: &Recipe, head: &Calibration) -> Result<Self, Refusal> {
        let [low, high] = recipe.conditions.range_mm;
        let range = Some(HeightRange { low, high });
        Ok(Self(head.triangulator(recipe.function.clone(), range)?))
    }

    /// x, y and z in mm of every `stride`-th pixel of its heights, NaN where not known.
    pub fn points(&self, recipe: &Recipe, stride: usize) -> [Vec<f32>; 3] {
        let width = recipe.conditions.camera.0 as usize;
        points(&self.0, (&recipe.arrays.golden_height, width), stride)
    }

    /// What a pixel in the middle of the frame sees of a surface that faces the camera, mm.
    pub fn pixel_mm(&self) -> Option<f64> {
        pitch(&self.0)
    }
}

/// What a map of deviations shows: what a gauge of the recipe was judged by.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownDeviation {
    /// Each pixel has the mean over the square of so many pixels about it; 1 = its own deviation.
    pub side: usize,
    /// Whether the recipe has the part's motion taken back.
    pub aligned: bool,
    /// Whether the motion was found, and taken back.
    pub placed: bool,
    /// The gauge; `None` if the recipe has no gauge of the deviation.
    pub gauge: Option<ShownGauge>,
}

/// The gauge that a map of deviations is of: of several, the one that uses most of its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShownGauge {
    /// The gauge's name in the recipe.
    pub name: Arc<str>,
    /// The gauge's value in mm; `None` if it could not be measured.
    pub value: Option<f64>,
    /// Where the value is.
    pub square: Option<Square>,
    /// The lower limit.
    pub low: Option<f64>,
    /// The upper limit.
    pub high: Option<f64>,
}

impl ShownGauge {
    /// The share of its limit that the value uses; below 0 without a value.
    fn used(&self) -> f64 {
        let Some(value) = self.value else { return -1.0 };
        let limit = if value < 0.0 { self.low } else { self.high };
        limit.map_or(0.0, |limit| value.abs() / limit.abs())
    }
}

impl Plan {
    /// The maps of a part from the frames of a sequence; `None` if the frames do not fit.
    pub fn layers(&self, sequence: usize, frames: &[Frame]) -> Option<Layers> {
        let (columns, rows, _) = self.conditions.camera;
        let production = &self.runs.get(sequence)?.production;
        let unknown = vec![f32::NAN; columns as usize * rows as usize];
        let (mut height_mm, mut sigma_mm) = (unknown.clone(), unknown.clone());
        let mut deviation_mm = unknown;
        let maps = Maps {
            heights: Some(&mut height_mm),
            sigma: Some(&mut sigma_mm),
            deviation: Some(&mut deviation_mm),
        };
        // Not the plan's: another part may be judged meanwhile.
        let mut strips = production.strips((rows as usize).div_ceil(STRIPS));
        let of = (self.arriving(sequence), frames);
        let found = self.run(&mut strips, of, maps, &mut Laps::now());
        let shown = self.shown(&found.ok()?.findings);
        let deviation_mm =
            Drawing::new(production, &strips).square_means(&deviation_mm, shown.side);
        drop(strips);
        let full_scale = production.decoder().full_scale();
        let modulation = self.modulation(sequence, frames)?;
        let counts = modulation.iter();
        Some(Layers {
            width: production.cubics().surface().width,
            height_mm,
            sigma_mm,
            deviation_mm,
            shown,
            triangulator: production.shared_triangulator(),
            modulation: counts.map(|b| b.counts(full_scale) as f32).collect(),
            full_scale,
        })
    }

    /// Which deviation a map of the part shows.
    fn shown(&self, findings: &Findings) -> ShownDeviation {
        let limits = self.demands.limits.iter().zip(&findings.readings);
        let gauges = self.production().gauges().iter().zip(limits);
        let deviations = gauges.filter_map(|(gauge, (limits, reading))| {
            let side = gauge.measure.facts().basis.square_side()?;
            let square = reading.and_then(|reading| reading.square);
            let gauge = ShownGauge {
                name: Arc::clone(&limits.name),
                value: reading.map(|reading| reading.value),
                square: square.map(Into::into),
                low: limits.low,
                high: limits.high,
            };
            Some((square.map_or(side, |square| square.side), gauge))
        });
        let used = |(_, gauge): &(usize, ShownGauge)| gauge.used();
        let gauge = deviations.max_by(|a, b| used(a).total_cmp(&used(b)));
        ShownDeviation {
            side: gauge.as_ref().map_or(1, |(side, _)| *side),
            aligned: self.demands.aligned,
            placed: findings.placed.is_some(),
            gauge: gauge.map(|(_, gauge)| gauge),
        }
    }

    /// The modulation of a part whose heights were just computed.
    pub(super) fn modulation(&self, sequence: usize, frames: &[Frame]) -> Option<Vec<Modulation>> {
        let run = self.runs.get(sequence)?;
        if let Some(pair) = &run.pair {
            let buffers = pair.lock().unwrap_or_else(PoisonError::into_inner);
            return Some(buffers.phases().modulation.clone());
        }
        let production = &run.production;
        let views: Result<Vec<_>, _> = frames.iter().map(seam::view).collect();
        let (decoder, map) = (production.decoder(), Some(production.map()));
        let phases = pipeline::decode(decoder, &views.ok()?, map, None).ok()?;
        Some(phases.modulation)
    }
}
