//! Bounds of every value of `recipe.json`: a value outside is refused, naming its key, before anything is computed with it.
//!
//! The same bounds hold for files that are read and for edits; `docs/formats.md` lists them.

use super::check::MAX_REGIONS;
use super::comparison::QualityFile;
use super::file::{PatternFile, RecipeFile, RegionFile, SequenceFile, UnseenFile};
use crate::head::calibration::CalibrationSigma;
use crate::station::MAX_GAUGES;
use algo::pattern::{MAX_FRAMES, Sequence, Shot};
use algo::phase::LeastModulation;
use hal::bounds::{
    FINGERPRINT_DIGITS, MAX_FRINGES, MAX_NOISE_COUNTS, MAX_RANGE_MM, MAX_SHIFT_TURNS, MAX_SIDE,
    MIN_NOISE_COUNTS, RATIOS, length, text, within,
};

/// The longest name of a recipe, region or gauge, in characters.
pub const LONGEST_NAME: usize = 64;
/// The longest part number: the registers of PART_NUMBER.
pub const LONGEST_PART_NUMBER: usize = 32;
/// Sequences that a part can be measured with; teaching makes four.
const MAX_SEQUENCES: usize = 8;
/// Corners of a region.
const MAX_CORNERS: usize = 256;
/// Farthest that a part may lie from where it was taught, mm.
pub const MAX_TOLERANCE_MM: f64 = 20.0;
/// Most exposures of a frame: with more, the amplitude of bright places has too few grey levels.
pub const MAX_EXPOSURES: u32 = 4;
/// Widest guard band, in multiples of u.
pub const MAX_GUARD_K: f64 = 10.0;
/// The last second of the year 9999.
const LAST_SECOND: u64 = 253_402_300_799;
/// Most captures that golden is the mean of.
const MAX_CAPTURES: usize = 1000;
/// Largest σ_z, mm: no head is worse.
const MAX_SIGMA_MM: f64 = 1000.0;

impl RecipeFile {
    /// Checks each value by itself; [`Recipe::check`](super::Recipe::check) checks that they fit each other and the arrays.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub fn check_bounds(&self) -> Result<(), String> {
        within("number", self.number, 1, 9999)?;
        text("name", &self.name, LONGEST_NAME)?;
        text("part_number", &self.part_number, LONGEST_PART_NUMBER)?;
        if !self.part_number.is_ascii() {
            let key = format!("part_number {:?}", self.part_number);
            return Err(format!("{key} has characters that are not ASCII"));
        }
        text("taught_by", &self.taught_by, LONGEST_NAME)?;
        within("taught_at_unix_s", self.taught_at_unix_s, 0, LAST_SECOND)?;
        text("calibration", &self.calibration, FINGERPRINT_DIGITS)?;
        let (camera, projector) = (&self.camera, &self.projector);
        within("camera.width", camera.width, 1, MAX_SIDE)?;
        within("camera.height", camera.height, 1, MAX_SIDE)?;
        within("camera.bit_depth", camera.bit_depth, 8, 16)?;
        within("projector.width", projector.width, 1, MAX_SIDE)?;
        within("projector.height", projector.height, 1, MAX_SIDE)?;
        if let PatternFile::Vertical { fringes } | PatternFile::Horizontal { fringes } =
            self.pattern
        {
            within("pattern.fringes", fringes, 1e-3, MAX_FRINGES)?;
        }
        length("sequences", self.sequences.len(), 1, MAX_SEQUENCES)?;
        each(
            "sequences",
            ".",
            &self.sequences,
            SequenceFile::check_bounds,
        )?;
        within("production", self.production, 0, self.sequences.len() - 1)?;
        let tolerance = self.placement_tolerance_mm;
        within("placement_tolerance_mm", tolerance, 0.0, MAX_TOLERANCE_MM)?;
        let [low, high] = self.range_mm;
        within("range_mm", low, -MAX_RANGE_MM, MAX_RANGE_MM)?;
        within("range_mm", high, low, MAX_RANGE_MM)?;
        if let Some(exposing) = &self.exposing {
            exposing.check_bounds("exposing")?;
        }
        within("exposures", self.exposures, 1, MAX_EXPOSURES)?;
        let (least, most) = (MIN_NOISE_COUNTS, MAX_NOISE_COUNTS);
        within("noise_counts", self.noise_counts, least, most)?;
        within("read_noise_counts", self.read_noise_counts, 0.0, most)?;
        within("shot_noise", self.shot_noise, 0.0, most)?;
        if let Some(counts) = self.golden_offset_counts {
            let full_scale = f64::from((1_u32 << camera.bit_depth) - 1);
            within("golden_offset_counts", counts, 0.0, full_scale)?;
        }
        within("golden_captures", self.golden_captures, 1, MAX_CAPTURES)?;
        let [least, most] = LeastModulation::BOUNDS;
        within("least_modulation", self.least_modulation, least, most)?;
        if let Some(CalibrationSigma {
            height_mm,
            length_mm,
        }) = self.calibration_sigma
        {
            within("calibration_sigma.height_mm", height_mm, 0.0, MAX_SIGMA_MM)?;
            within("calibration_sigma.length_mm", length_mm, 0.0, MAX_SIGMA_MM)?;
        }
        let range = self.expansion_range_turns;
        within("expansion_range_turns", range, 1e-3, MAX_FRINGES)?;
        within("min_coverage", self.min_coverage, 0.0, 1.0)?;
        within("guard_k", self.guard_k, 0.0, MAX_GUARD_K)?;
        length("regions", self.regions.len(), 0, MAX_REGIONS)?;
        each("regions", ".", &self.regions, RegionFile::check_bounds)?;
        length("gauges", self.gauges.len(), 1, MAX_GAUGES)?;
        let largest = camera.width.max(camera.height) as usize;
        each("gauges", ": ", &self.gauges, |gauge| {
            gauge.check_bounds(largest)
        })?;
        let comparison = self.comparison.iter();
        for (which, quality) in
            comparison.flat_map(|both| [("fixed", &both.fixed), ("adaptive", &both.adaptive)])
        {
            quality
                .check_bounds()
                .map_err(|error| format!("comparison.{which}.{error}"))?;
        }
        for tried in &self.tried {
            within("tried.passes", tried.passes, 0.0, 1.0)?;
        }
        if let Some(good_parts) = &self.good_parts {
            good_parts
                .check_bounds()
                .map_err(|error| format!("good_parts.{error}"))?;
        }
        Ok(())
    }
}

/// Checks each element of the list `name`; an error begins with the element's place and `separator`.
fn each<T>(
    name: &str,
    separator: &str,
    list: &[T],
    check: impl Fn(&T) -> Result<(), String>,
) -> Result<(), String> {
    let mut places = list.iter().enumerate();
    places.try_for_each(|(at, element)| {
        check(element).map_err(|error| format!("{name}[{at}]{separator}{error}"))
    })
}

impl SequenceFile {
    fn check_bounds(&self) -> Result<(), String> {
        length("frames", self.frames.len(), 3, MAX_FRAMES)?;
        let [low, high] = RATIOS;
        each("frames", ": ", &self.frames, |shot: &Shot| {
            within("ratio", shot.ratio, low, high)?;
            within("shift", shot.shift, -MAX_SHIFT_TURNS, MAX_SHIFT_TURNS)?;
            let mut harmonics = shot.waveform.harmonics();
            harmonics.try_for_each(|(_, share)| within("share of a harmonic", share, -1.0, 1.0))
        })?;
        within("sigma_mm", self.sigma_mm, 0.0, MAX_SIGMA_MM)?;
        within("safe_share", self.safe_share, 0.0, 1.0)?;
        within(
            "ripple_mm",
            self.ripple_mm.unwrap_or(0.0),
            0.0,
            MAX_SIGMA_MM,
        )?;
        if let Some(UnseenFile { part, darkest }) = self.unseen_orders {
            within("unseen_orders.part", part, 0.0, 1.0)?;
            within("unseen_orders.darkest", darkest, 0.0, 1.0)?;
        }
        Sequence::from_frames(&self.frames)
            .map(drop)
            .map_err(|error| format!("frames: {error}"))
    }
}

impl RegionFile {
    fn check_bounds(&self) -> Result<(), String> {
        text("name", &self.name, LONGEST_NAME)?;
        length("polygon", self.polygon.len(), 3, MAX_CORNERS)?;
        // Polygons are clipped to the frame: corners up to one frame's width outside of it are enough for any shape.
        let far = f64::from(MAX_SIDE);
        for corner in self.polygon.as_flattened() {
            within("polygon", *corner, -far, 2.0 * far)?;
        }
        Ok(())
    }
}

impl QualityFile {
    fn check_bounds(&self) -> Result<(), String> {
        within("frames", self.frames, 1, MAX_FRAMES)?;
        within("sigma_mm", self.sigma_mm, 0.0, MAX_SIGMA_MM)?;
        within("coverage", self.coverage, 0.0, 1.0)
    }
}
