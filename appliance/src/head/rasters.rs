//! The grey rasters that the projector shows for a phase function, corrected by the inverse of its
//! measured grey response.

use crate::head::calibration::Calibration;
use crate::head::seam;
use algo::pattern::{Encoder, GreyRaster, PhaseFunction, Shot};
use hal::error::Error;
use hal::head::Head;
use hal::projector::Raster;
use rayon::prelude::*;

/// How much light patterns give.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Illumination {
    /// Each frame is exposed so many times as long as the camera is set to.
    pub exposures: u32,
    /// The light of each projector pixel, in 1/255 of what its pattern asks for; empty: all of it.
    pub amplitude: Vec<u8>,
}

impl Default for Illumination {
    /// One exposure of the whole light.
    fn default() -> Self {
        Self {
            exposures: 1,
            amplitude: Vec::new(),
        }
    }
}

impl Illumination {
    /// Loads the shots of a phase function, to be exposed in this way.
    ///
    /// # Errors
    /// The error of the projector, or if the head cannot expose for longer.
    pub fn load(
        &self,
        head: &mut Head,
        function: &PhaseFunction,
        shots: &[Shot],
        calibration: &Calibration,
    ) -> Result<(), Error> {
        head.load(self.rasters(function, shots, calibration)?)?;
        head.expose(self.exposures)
    }

    /// The grey raster of each shot of a phase function.
    ///
    /// # Errors
    /// Never for a phase function that could be made.
    pub fn rasters(
        &self,
        function: &PhaseFunction,
        shots: &[Shot],
        calibration: &Calibration,
    ) -> Result<Vec<Raster>, Error> {
        let response = calibration.response.as_ref();
        let whole = self.amplitude.is_empty();
        let encoder = Encoder::new(response.filter(|_| whole), shots);
        let raster = |&shot: &Shot| {
            let mut grey = encoder.raster(function, shot);
            if !whole {
                self.attenuate(&mut grey);
                if let Some(response) = response {
                    grey.pixels
                        .iter_mut()
                        .for_each(|level| *level = response.level_for(*level));
                }
            }
            Raster::new(grey.width as u32, grey.height as u32, grey.pixels)
        };
        shots.par_iter().map(raster).collect()
    }

    /// What is exposed for longer, for people; none for one exposure of the whole light.
    pub fn words(&self) -> Option<String> {
        let least = self.amplitude.iter().min()?;
        Some(format!(
            "frames are exposed {} times as long, with {:.0} % of the projector's light where the part is brightest",
            self.exposures,
            f64::from(*least) / 2.55
        ))
    }

    /// Makes linear light darker, rounded to the nearest level.
    fn attenuate(&self, grey: &mut GreyRaster) {
        for (level, &share) in grey.pixels.iter_mut().zip(&self.amplitude) {
            *level = ((u32::from(*level) * u32::from(share) + 127) / 255) as u8;
        }
    }
}

/// Vertical fringes of `pitch` pixels over a projector of this size, at each of so many shifts of a
/// turn.
///
/// # Errors
/// `Unsupported` if the projector is too small for them.
pub fn fringes(
    size: (u32, u32),
    pitch: u32,
    shifts: usize,
    calibration: &Calibration,
) -> Result<Vec<Raster>, Error> {
    let function = seam::fringes(true, size, f64::from(pitch))?;
    let shots: Vec<Shot> = Shot::level(1.0, shifts).collect();
    rasters(&function, &shots, calibration)
}

/// The grey raster of each shot of a phase function.
///
/// # Errors
/// Never for a phase function that could be made.
pub fn rasters(
    function: &PhaseFunction,
    shots: &[Shot],
    calibration: &Calibration,
) -> Result<Vec<Raster>, Error> {
    Illumination::default().rasters(function, shots, calibration)
}
