//! The adaptive pattern of a part, from its preliminary measurement.

use super::TeachError;
use crate::head::calibrated::{MeasuredPart, STRAIGHT_PITCH_PX, STRAIGHT_SHIFTS, straight_fringes};
use crate::head::calibration::Calibration;
use crate::head::calibration::file::ContrastFile;
use crate::head::scan::Scan;
use algo::adaptive::noise::Light;
use algo::adaptive::{Blur, FringeOptics, ProjectorMap, Spread, noise};
use algo::geometry::Triangulator;
use algo::pattern::{PhaseFunction, Shot};
use algo::phase::Trust;
use algo::pipeline::Progress;
use algo::units::{AbsolutePhase, Height};

/// What is projected first, on a part of which nothing is known.
#[derive(Clone, Debug)]
pub struct Preliminary {
    /// Straight vertical fringes.
    pub function: PhaseFunction,
    /// What each frame shows.
    pub shots: Vec<Shot>,
}

/// The pattern made for a part.
#[derive(Clone, Debug)]
pub struct AdaptivePattern {
    /// Φ_P over the projector's raster.
    pub function: PhaseFunction,
    /// Φ of each camera pixel under this pattern, by the preliminary measurement.
    pub expected: Vec<AbsolutePhase>,
}

impl Preliminary {
    /// The preliminary pattern for a projector of so many columns and rows.
    ///
    /// # Errors
    /// If the projector is too small.
    pub fn new(raster: (usize, usize)) -> Result<Self, TeachError> {
        let (function, shots) = straight_fringes(raster)?;
        Ok(Self { function, shots })
    }

    /// The pattern for the part that was measured with these fringes: that of least error for the
    /// part's light, the noise of the camera and the blur that the part and the calibration show.
    /// `progress` gets the share that is done.
    ///
    /// # Errors
    /// If nothing of the part is known, or its pattern cannot be shown.
    pub fn adapt(
        &self,
        part: &MeasuredPart,
        calibration: &Calibration,
        progress: Progress<'_>,
    ) -> Result<AdaptivePattern, TeachError> {
        let map = ProjectorMap::from_heights(&part.triangulator, &part.heights);
        progress(0.03);
        let slopes = map.slopes(noise::MAX_SLOPE);
        let blur = self.blur(part, calibration, &slopes)?;
        let light = Light::of(
            &part.phases,
            &part.decoder,
            &slopes,
            1.0 / STRAIGHT_PITCH_PX,
            &blur,
            Some(calibration.noise_counts),
            &|share| progress(0.1 + 0.4 * share),
        );
        let optics = FringeOptics {
            blur,
            projector_pitch: noise::PROJECTOR_PITCH,
            image_pitch: noise::IMAGE_PITCH,
        };
        let (columns, rows) = (self.function.columns(), self.function.rows());
        let function = noise::adapt(&map, columns, rows, &optics, &light, &|share| {
            progress(0.5 + 0.4 * share);
        })?;
        progress(0.9);
        let trusted = map.without_blurred_silhouettes(blur.camera);
        Ok(AdaptivePattern {
            expected: trusted.expected_phase(&function),
            function,
        })
    }

    /// The blur by the modulation of the finest and of the coarsest level on the part, and by the
    /// contrast that was calibrated.
    fn blur(
        &self,
        part: &MeasuredPart,
        calibration: &Calibration,
        slopes: &[[f64; 2]],
    ) -> Result<Blur, TeachError> {
        let range = self.function.range();
        let coarse = Scan::new(
            range,
            &self.shots[..STRAIGHT_SHIFTS],
            &part.frames[..STRAIGHT_SHIFTS],
        )
        .map(|coarse| coarse.trusting(part.decoder.least_modulation()))
        .and_then(|coarse| coarse.phases(None))
        .map_err(TeachError::rig)?;
        let fine = 1.0 / STRAIGHT_PITCH_PX;
        let frequencies = [fine, fine * self.shots[0].ratio];
        let resolved = (0..slopes.len()).filter(|&at| part.phases.trust[at] == Trust::Resolved);
        let spreads = resolved.filter_map(|at| {
            let [fine, coarse] =
                [&part.phases, &coarse].map(|phases| f64::from(phases.modulation[at].to_bits()));
            Spread::new(slopes[at], fine / coarse, frequencies)
        });
        let plate = calibration.contrast.as_ref();
        let plate = plate.and_then(|contrast| on_plate(contrast, &part.triangulator));
        Ok(Blur::fit(spreads.collect(), plate).unwrap_or_default())
    }
}

/// The blur by the contrast of all pitches that calibration measured, on the reference plane in the
/// middle of the frame. A pitch counts by how much blur weakens it.
fn on_plate(contrast: &ContrastFile, triangulator: &Triangulator) -> Option<Spread> {
    let [coarsest, finer @ ..] = &contrast.pitches[..] else {
        return None;
    };
    let camera = triangulator.camera();
    let (u, v) = (camera.width() / 2, camera.height() / 2);
    let column = |u, v| {
        let point = triangulator.point(u, v, Height::from_mm(0.0))?;
        Some(triangulator.projector_point(point)?.0)
    };
    let here = column(u, v)?;
    let slope = [column(u + 1, v)? - here, column(u, v + 1)? - here];
    let coarse = 1.0 / f64::from(coarsest.pitch_px);
    let (mut sum, mut weights) = (0.0, 0.0);
    let mut steepness = None;
    for pitch in finer {
        let fine = 1.0 / f64::from(pitch.pitch_px);
        let share = pitch.contrast / coarsest.contrast;
        let Some(spread) = Spread::new(slope, share, [fine, coarse]) else {
            continue;
        };
        let weight = (fine * fine - coarse * coarse).powi(2);
        sum += weight * spread.variance;
        weights += weight;
        steepness = Some(spread.steepness);
    }
    Some(Spread {
        steepness: steepness?,
        variance: sum / weights,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::calibrated::CalibratedHead;
    use crate::head::calibration::file::PitchFile;
    use algo::adaptive::contrast;
    use sim::parts::Sphere;
    use sim::{Part, Scenario};
    use std::time::Duration;

    /// A sphere in front of a small head with these σ of both lenses: what is projected, and its
    /// measurement.
    fn sphere(projector: f64, camera: f64) -> (Preliminary, MeasuredPart, Calibration) {
        let mut scenario = Scenario {
            part: Part::Sphere(Sphere::default()),
            sub_rays: 2,
            ..Scenario::default()
        };
        (scenario.rig.camera.width, scenario.rig.camera.height) = (256, 256);
        (scenario.rig.projector.width, scenario.rig.projector.height) = (512, 384);
        scenario.optics.projector_blur_px = projector;
        scenario.optics.camera_blur_px = camera;
        let (mut head, stage) = sim::head(&scenario).unwrap();
        let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
        let preliminary = Preliminary::new((512, 384)).unwrap();
        let mut head = CalibratedHead::new(&mut head, &calibration, Duration::from_secs(5));
        let Preliminary { function, shots } = &preliminary;
        let measured = head.measure(function, shots, None, &|_| ()).unwrap();
        (preliminary, measured, calibration)
    }

    #[test]
    fn the_blur_of_both_lenses_is_found_on_a_sphere() {
        for [projector, camera] in [[1.0, 0.5], [0.5, 0.0]] {
            let (preliminary, measured, calibration) = sphere(projector, camera);
            let map = ProjectorMap::from_heights(&measured.triangulator, &measured.heights);
            let slopes = map.slopes(noise::MAX_SLOPE);
            let found = preliminary.blur(&measured, &calibration, &slopes).unwrap();
            println!("{projector} and {camera}: {found:?}");
            assert!((found.projector - projector).abs() < 0.1, "{found:?}");
            assert!((found.camera - camera).abs() < 0.15, "{found:?}");
        }
    }

    #[test]
    fn the_calibrated_contrast_has_the_blur_of_the_plate() {
        let (_, measured, _) = sphere(0.5, 0.0);
        let blur = Blur {
            projector: 1.2,
            camera: 0.0,
        };
        let kept =
            |pitch: u32| contrast(&blur, 1.0 / f64::from(pitch), [1.0 / f64::from(pitch), 0.0]);
        let pitches = [64, 16, 12, 8].map(|pitch_px| PitchFile {
            pitch_px,
            contrast: kept(pitch_px) / kept(64),
        });
        let mut file = ContrastFile {
            modulation_counts: 100.0,
            pitches: pitches.into(),
        };
        let found = on_plate(&file, &measured.triangulator).unwrap();
        // The plate's slope is nearly 1, as above.
        assert!((found.variance - 1.44).abs() < 0.05, "{found:?}");
        assert!((0.5..1.5).contains(&found.steepness), "{found:?}");
        file.pitches.truncate(1);
        assert_eq!(on_plate(&file, &measured.triangulator), None);
    }
}
