//! Maps of a measured part for the page (height, deviation from golden, modulation), and its point cloud.

use super::Plan;
use crate::head::seam;
use crate::output::cloud::ply;
use algo::pipeline;
use algo::units::{Height, Modulation};
use hal::frame::Frame;
use std::sync::PoisonError;

/// Maps of one part, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Pixels per row.
    pub width: usize,
    /// z in mm, NaN where not resolved.
    pub height_mm: Vec<f32>,
    /// Height above golden in mm, NaN where either is not known.
    pub deviation_mm: Vec<f32>,
    /// Modulation of the finest level in counts.
    pub modulation: Vec<f32>,
}

impl Plan {
    /// The maps of a part from the frames of a sequence; `None` if the frames do not fit.
    pub fn layers(&self, sequence: usize, frames: &[Frame]) -> Option<Layers> {
        let height_mm = self.heights(sequence, frames)?;
        let production = &self.runs.get(sequence)?.production;
        let golden = &production.cubics().surface().height;
        let deviation = height_mm.iter().zip(golden).map(|(&here, golden)| {
            if golden.is_known() {
                here - golden.mm() as f32
            } else {
                f32::NAN
            }
        });
        let deviation_mm = deviation.collect();
        let full_scale = production.decoder().full_scale();
        let modulation = self.modulation(sequence, frames)?;
        let counts = modulation.iter();
        Some(Layers {
            width: production.cubics().surface().width,
            height_mm,
            deviation_mm,
            modulation: counts.map(|b| b.counts(full_scale) as f32).collect(),
        })
    }

    /// The modulation of a part whose heights were just computed.
    fn modulation(&self, sequence: usize, frames: &[Frame]) -> Option<Vec<Modulation>> {
        let run = self.runs.get(sequence)?;
        if let Some(pair) = &run.pair {
            let buffers = pair.buffers.lock().unwrap_or_else(PoisonError::into_inner);
            return Some(buffers.phases().modulation.clone());
        }
        let production = &run.production;
        let views: Result<Vec<_>, _> = frames.iter().map(seam::view).collect();
        let (decoder, map) = (production.decoder(), Some(production.map()));
        let phases = pipeline::decode(decoder, &views.ok()?, map, None).ok()?;
        Some(phases.modulation)
    }

    /// The point cloud of a part as binary PLY, with its modulation as intensity; `None` as for [`Self::layers`].
    pub fn cloud(&self, sequence: usize, frames: &[Frame]) -> Option<Vec<u8>> {
        let layers = self.layers(sequence, frames)?;
        let production = &self.runs.get(sequence)?.production;
        let full_scale = f32::from(production.decoder().full_scale());
        // NaN becomes an unknown height.
        let heights = layers.height_mm.iter();
        let heights = heights.map(|&mm| Height::from_mm(f64::from(mm)));
        let shade = |at: usize| {
            let intensity = layers.modulation[at] * 2.0 / full_scale * 255.0;
            (intensity as u8, f32::NAN)
        };
        let triangulator = production.triangulator();
        Some(ply(triangulator, layers.width, heights, shade))
    }
}
