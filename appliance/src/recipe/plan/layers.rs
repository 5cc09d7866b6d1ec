//! Maps of a measured part for the page (height, deviation from golden, modulation), and its point cloud.

use super::Plan;
use crate::head::seam;
use crate::output::cloud::ply;
use algo::pipeline;
use algo::units::Height;
use hal::frame::Frame;

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
        let decoder = production.decoder();
        let views: Result<Vec<_>, _> = frames.iter().map(seam::view).collect();
        let phases = pipeline::decode(decoder, &views.ok()?, Some(production.map()), None).ok()?;
        let full_scale = decoder.full_scale();
        let counts = phases.modulation.iter();
        Some(Layers {
            width: phases.width,
            height_mm,
            deviation_mm,
            modulation: counts.map(|b| b.counts(full_scale) as f32).collect(),
        })
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
