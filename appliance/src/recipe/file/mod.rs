//! The manifest `recipe.json` of a recipe, version 3. Frozen: see `docs/formats.md`.
//!
//! [`feature`] has its features and datum systems, [`gauge`] and `gauge_keys` its gauges, [`kinds`] the
//! tables of what there is of both, [`gauges_toml`] all of them as text for people, `sequence` and
//! `taught` what teaching adds. [`rules`] refuses what breaks a rule, [`archive`] is the ZIP with
//! arrays and fingerprint, [`recipe`] its checked form.

pub mod archive;
pub mod demands;
pub mod feature;
pub mod gauge;
mod gauge_keys;
pub mod gauges_toml;
pub mod kinds;
pub mod recipe;
pub mod refusal;
pub mod rules;
mod sequence;
mod taught;

pub use sequence::{SequenceFile, SequenceKind, UnseenFile, safe};
pub use taught::{ComparisonFile, GoodPartsFile, ModelsFile, TriedFile};

pub use feature::LONGEST_NAME;

use crate::head::calibration::{Calibration, CalibrationSigma, HeightsBy};
use crate::head::exposing::Exposing;
use crate::recipe::{DatumFile, FeatureFile, GaugeFile, Refusal};
use crate::station::control::MAX_RECIPE;
use algo::inspect::Marking;
use algo::phase::LeastModulation;
use hal::bounded;
use hal::bounds::{
    FINGERPRINT_DIGITS, Fields, LAST_SECOND, Longest, MAX_FRINGES, MAX_NOISE_COUNTS, MAX_SIDE,
    MIN_NOISE_COUNTS,
};
use hal::replay::recording::PatternSpec;
use rules::Rules;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// The name of the format.
pub const FORMAT: &str = "fringed-recipe";
/// The version that this program writes, and the only one that it reads.
pub const VERSION: u32 = 3;
/// The longest part number: the registers of PART_NUMBER.
pub const LONGEST_PART_NUMBER: usize = 32;
/// Farthest that a part may lie from where it was taught, mm.
pub const MAX_TOLERANCE_MM: f64 = 20.0;
/// Most exposures of a frame: with more, the amplitude of bright places has too few grey levels.
pub const MAX_EXPOSURES: u32 = 4;
/// Widest guard band, in multiples of u.
pub const MAX_GUARD_K: f64 = 10.0;
/// Bounds of the least modulation.
const LEAST_MODULATION: RangeInclusive<f64> =
    LeastModulation::BOUNDS[0]..=LeastModulation::BOUNDS[1];
/// Most captures that golden is the mean of.
const MAX_CAPTURES: usize = 1000;

bounded! {
    /// Everything in a recipe that is not an array.
    pub struct RecipeFile {
        /// [`FORMAT`].
        pub format: String,
        /// [`VERSION`].
        pub version: u32,
        /// SHA-256 over all members with this field zeroed, 64 hexadecimal digits.
        pub fingerprint: String,
        /// 1–9999.
        pub number: u16 = 1..=MAX_RECIPE,
        /// The key that a PLC may select by, at most 32 ASCII characters.
        pub part_number: String = Longest(LONGEST_PART_NUMBER),
        /// For people.
        pub name: String = Longest(LONGEST_NAME),
        /// Who or what taught it.
        pub taught_by: String = Longest(LONGEST_NAME),
        /// When, in seconds since 1970 UTC; 0 if the clock was not synchronised.
        pub taught_at_unix_s: u64 = 0..=LAST_SECOND,
        /// Fingerprint of the calibration that it was made for.
        pub calibration: String = Longest(FINGERPRINT_DIGITS),
        /// The camera's frames.
        pub camera: CameraFile = Fields,
        /// The projector's raster.
        pub projector: RasterFile = Fields,
        /// The pattern that is projected.
        pub pattern: PatternFile,
        /// The sequences that the part can be measured with, from the cheapest to the full one.
        pub sequences: Vec<SequenceFile>,
        /// Which of these sequences is projected first in production, counted from 0; longer ones
        /// may follow in the same cycle.
        pub production: usize,
        /// Whether a cycle begins with the fringe and its complement at ratio 1, before the
        /// sequence for production.
        pub two_frames: bool,
        /// How far a part may lie from where it was taught, in any direction, mm.
        pub placement_tolerance_mm: f64 = 0.0..=MAX_TOLERANCE_MM,
        /// Whether the part's motion is measured and compensated before it is gauged.
        pub alignment: AlignmentKind,
        /// Working range of z in mm.
        pub range_mm: [f64; 2],
        /// Exposure and gain that the camera was set to; `None` where it was taught from a
        /// recording.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub exposing: Option<Exposing> = Fields,
        /// Each frame is exposed so many times as long as the head is set to, 1 to 4.
        pub exposures: u32 = 1..=MAX_EXPOSURES,
        /// σ of one sample in counts, at half the light of white.
        pub noise_counts: f64 = MIN_NOISE_COUNTS..=MAX_NOISE_COUNTS,
        /// σ of one sample without light, counts.
        pub read_noise_counts: f64 = 0.0..=MAX_NOISE_COUNTS,
        /// Variance of a sample in counts² that a count of golden's modulation adds.
        pub shot_noise: f64 = 0.0..=MAX_NOISE_COUNTS,
        /// Median of the mean of each pixel's samples over golden's surface, counts: with it a
        /// pattern that is blurred is told from one that is too dark. `None` where it was taught
        /// from a recording.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub golden_offset_counts: Option<f64>,
        /// Captures that golden is the mean of; 1 where it was taught from a recording.
        pub golden_captures: usize = 1..=MAX_CAPTURES,
        /// The least modulation that is trusted, in counts of an 8-bit sample.
        pub least_modulation: f64 = LEAST_MODULATION,
        /// The models of the head that it was taught with.
        pub models: ModelsFile = Fields,
        /// σ by the uncertainty of the calibration that the recipe was made for; `None` where it is
        /// not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub calibration_sigma: Option<CalibrationSigma> = Fields,
        /// Whether pixels are refused beside which light changes steeply: the part mirrors or is printed on.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        pub light_edges: bool,
        /// Whether all that was seen was taken for the part, also what lies behind it all round.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        pub everything: bool,
        /// What a person has marked in the picture when it was taught.
        #[serde(default, skip_serializing_if = "Marking::is_empty")]
        pub marking: Marking,
        /// Heights that lie so many mm behind golden's, or farther, are those of what the part lies on;
        /// `None` if nothing else was seen.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub surroundings_mm: Option<f64> = 0.0..=1000.0,
        /// The plane that the part lies on: z at x = y = 0, mm, and its rise along x and y, mm per mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub ground_mm: Option<[f64; 3]> = -1e4..=1e4,
        /// |ΔΦ| about the golden phase, in turns, up to which `height_slope.npy` and
        /// `height_curvature.npy` give the height accurately.
        pub expansion_range_turns: f64 = 1e-3..=MAX_FRINGES,
        /// Least share of the golden pixels that must be resolved, else the verdict is INVALID.
        pub min_coverage: f64 = 0.0..=1.0,
        /// A value inside its limits but nearer to one than this many times its uncertainty u is
        /// neither PASS nor FAIL.
        pub guard_k: f64 = 0.0..=MAX_GUARD_K,
        /// Whether the recipe only measures: no gauge has a limit that a part can miss.
        pub judges_nothing: bool,
        /// Geometry that is measured of the part.
        pub features: Vec<FeatureFile>,
        /// Datum systems of features.
        pub datums: Vec<DatumFile>,
        /// At most 64, in the order of their slots.
        pub gauges: Vec<GaugeFile>,
        /// Fixed against adaptive pattern, as measured when it was taught; `None` if it was taught
        /// from a recording.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub comparison: Option<ComparisonFile> = Fields,
        /// The deviation of good parts, as predicted when it was taught; `None` where the limits
        /// are not those that teaching set.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub good_parts: Option<GoodPartsFile> = Fields,
        /// Per gauge that was tried with golden at other places, how many good parts would pass;
        /// empty if nothing was tried.
        pub tried: Vec<TriedFile> = Fields,
    }

}

bounded! {
    /// A camera's frames.
    #[derive(Eq)]
    pub struct CameraFile {
        /// Columns.
        pub width: u32 = 1..=MAX_SIDE,
        /// Rows.
        pub height: u32 = 1..=MAX_SIDE,
        /// Bits per sample.
        pub bit_depth: u8 = 8..=16,
    }

    /// A projector's raster.
    #[derive(Eq)]
    pub struct RasterFile {
        /// Columns.
        pub width: u32 = 1..=MAX_SIDE,
        /// Rows.
        pub height: u32 = 1..=MAX_SIDE,
    }
}

/// A phase function, as in recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum PatternFile {
    /// Φ_P = fringes · ξ / width.
    Vertical {
        /// Fringes over the projector's width.
        fringes: f64,
    },
    /// Φ_P = fringes · η / height.
    Horizontal {
        /// Fringes over the projector's height.
        fringes: f64,
    },
    /// Φ_P in the member `phase_function.npy`.
    File,
}

impl RecipeFile {
    /// The head that it was taught with, as far as it is needed to measure golden.
    ///
    /// # Errors
    /// In words: a model is absurd, and why.
    pub fn head(&self) -> Result<Calibration, Refusal> {
        let CameraFile {
            width,
            height,
            bit_depth,
        } = self.camera;
        let raster = (self.projector.width, self.projector.height);
        let frames = (width, height, bit_depth);
        let ModelsFile {
            camera,
            projector,
            plane,
        } = &self.models;
        let models = (camera, projector);
        let by_models = Calibration::new(frames, raster, models, self.noise_counts)
            .map_err(|error| format!("models: {error}"))?;
        Ok(Calibration {
            plane: plane.clone(),
            heights_by: match plane {
                Some(_) => HeightsBy::Measured,
                None => HeightsBy::Models,
            },
            sigma: self.calibration_sigma,
            ..by_models
        })
    }

    /// A feature by its name.
    pub fn feature(&self, name: &str) -> Option<&FeatureFile> {
        self.features.iter().find(|feature| feature.name == name)
    }

    /// Whether a gauge is of a contour.
    pub(crate) fn is_of_contour(&self, gauge: &GaugeFile) -> bool {
        let is_contour = |name: &String| self.feature(name).is_some_and(|of| of.kind.is_contour());
        gauge.of.iter().any(is_contour)
    }

    /// Whether any gauge is of a contour.
    pub(crate) fn has_contours(&self) -> bool {
        self.gauges.iter().any(|gauge| self.is_of_contour(gauge))
    }

    /// Whether no gauge has a limit that a part can miss.
    pub(crate) fn is_without_limits(&self) -> bool {
        !self.gauges.iter().any(GaugeFile::can_fail)
    }

    /// Checks the bounds of all values, and that what is named is there;
    /// [`Recipe::check`](crate::recipe::Recipe::check) checks that they fit the arrays.
    ///
    /// # Errors
    /// The first that is wrong, with its key and the bounds.
    pub fn check_bounds(&self) -> Result<(), Refusal> {
        rules::check(self, Rules::Bounds)
    }

    /// Refuses a recipe whose verdict does not depend on the part as its gauges say, and one
    /// without any limit that does not state `judges_nothing`.
    ///
    /// # Errors
    /// With the name of the first such gauge and the remedy.
    pub(crate) fn check_judging(&self) -> Result<(), Refusal> {
        rules::check(self, Rules::Judging)
    }
}

impl PatternFile {
    /// The phase function of a recording's pattern.
    pub fn of(pattern: &PatternSpec) -> Self {
        match *pattern {
            PatternSpec::Vertical { fringes } => Self::Vertical { fringes },
            PatternSpec::Horizontal { fringes } => Self::Horizontal { fringes },
            PatternSpec::File { .. } => Self::File,
        }
    }
}

/// How a part's motion against the taught one is compensated before it is gauged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentKind {
    /// Not at all.
    None,
    /// As a small rigid motion.
    Rigid,
}
