//! Makes a recipe from a golden measurement, which comes from a head or from a recording.

use super::captures::Offsets;
use super::good_parts::DEVIATION_MM;
use super::part::SceneFacts;
use super::planner::Choice;
use super::sides::SIDES;
use super::{TeachError, part, planner};
use crate::head::calibrated::EmptyStation;
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::recipe::file::archive::Arrays;
use crate::recipe::file::{CameraFile, FORMAT, RasterFile, VERSION, archive};
use crate::recipe::file::{ComparisonFile, ModelsFile};
use crate::recipe::{
    AlignmentKind, FeatureFile, GaugeFile, PatternFile, Recipe, RecipeFile, Refusal,
};
use crate::system::headway::Headway;
use algo::adaptive::phase_reach;
use algo::frame::SampleNoise;
use algo::geometry::Triangulator;
use algo::inspect::{Marking, Measure, Surroundings, eroded, openings};
use algo::pattern::Shot;
use algo::phase::{Decoder, Trust};
use algo::pipeline;
use algo::pipeline::{HeightMap, KnownSurface, PhaseMap};
use std::io::Cursor;
use std::sync::Arc;

/// The area where deviations are compared is eroded by this many pixels on each side: pixels at
/// silhouettes mix two surfaces.
const EROSION_PX: usize = 2;
/// Pixels whose taught height is less certain than this are not compared, mm (1 σ).
const MAX_SIGMA_MM: f64 = 0.25;
/// Least share of the golden surface that must be resolved.
const MIN_COVERAGE: f64 = 0.80;
/// Guard bands of new recipes: with k = 1.65 one in 20 parts that lie just outside of a limit would
/// pass (ISO 14253-1:2017), with 2 one in 44.
const GUARD_K: f64 = 2.0;
/// An opening has at least this many pixels.
const OPENING_PIXELS: usize = 60;
/// At most this share of an opening's region may be resolved on a good part.
const OPENING_COVERAGE: f64 = 0.25;
/// At most this many openings get a gauge, the largest ones.
const MAX_OPENINGS: usize = 8;
/// Half the diagonals of an opening's region, an upright diamond, are at least this many pixels
/// long.
const OPENING_REACH: usize = 4;
/// |ΔΦ| up to which the expansion of the height is used, turns.
const EXPANSION_TURNS: f64 = 0.5;

/// What teaches where nobody is known who ordered it.
pub const THIS_PROGRAM: &str = concat!("fringed ", env!("CARGO_PKG_VERSION"));

/// Names of a recipe, its placement tolerance and its exposures.
#[derive(Clone, Debug)]
pub struct Naming {
    /// 1–9999.
    pub number: u16,
    /// The key for a PLC.
    pub part_number: String,
    /// For people.
    pub name: String,
    /// Who or what taught it.
    pub taught_by: String,
    /// When, in seconds since 1970 UTC; 0 if not known.
    pub taught_at_unix_s: u64,
    /// How far any corner of a part may lie from where it was taught, mm.
    pub placement_tolerance_mm: f64,
    /// Each frame is exposed so many times as long as the head is set to, 1 to 4; `None`: as the part needs.
    pub exposures: Option<u32>,
    /// Whether all that is seen is the part, also what lies behind it.
    pub everything: bool,
    /// What a person has marked in the picture.
    pub marking: Marking,
    /// What is seen without a part, if it was recorded.
    pub empty: Option<Arc<EmptyStation>>,
    /// The limit of the deviation, ± mm, that good parts must keep; `None` where teaching promises none.
    pub limit_mm: Option<f64>,
}

impl Naming {
    /// What is said of the part's surroundings.
    pub fn told(&self) -> SceneFacts<'_> {
        SceneFacts {
            everything: self.everything,
            marking: &self.marking,
            empty: self.empty.as_deref(),
            tolerance_mm: self.placement_tolerance_mm,
        }
    }
}

/// A measured golden part.
pub struct GoldenPart<'a> {
    /// The head's calibration.
    pub calibration: &'a Calibration,
    /// The pattern's file form; the function itself is the triangulator's.
    pub pattern: PatternFile,
    /// The light with which it was measured.
    pub illumination: Illumination,
    /// Whether pixels were refused beside which light changes steeply.
    pub light_edges: bool,
    /// What each frame of the full sequence shows.
    pub full: &'a [Shot],
    /// How these frames were decoded.
    pub decoder: Decoder,
    /// The geometry with its phase function.
    pub triangulator: Triangulator,
    /// Golden phase of each camera pixel, with its modulation and trust.
    pub phases: PhaseMap,
    /// Golden height of each camera pixel, with the σ of one capture.
    pub heights: HeightMap,
    /// For each of the other sequences, in their order, its phase less `phases`; empty if they were
    /// not measured.
    pub offsets: Vec<Offsets>,
    /// Golden's signal, as [`Arrays::golden_signal`].
    pub signal: Vec<i16>,
    /// The noise of a sample by the modulation of its pixel in one capture.
    pub noise: SampleNoise,
    /// Median of the mean samples of the part's pixels, counts; `None` where it was not measured.
    pub offset_counts: Option<f64>,
    /// What was left out of `phases` and `heights`; `None` if nothing but the part was seen.
    pub surroundings: Option<Surroundings>,
    /// Number of captures that `phases` and `heights` are the mean of; their σ is that of one
    /// capture.
    pub captures: usize,
    /// Fixed against adaptive pattern, if a fixed one was measured as well.
    pub comparison: Option<ComparisonFile>,
}

/// A recipe that is not packed yet.
#[derive(Debug)]
pub struct UnsealedRecipe {
    /// The file, without its fingerprint.
    pub manifest: RecipeFile,
    /// Its arrays.
    pub arrays: Arrays,
    /// The production sequence, with the reasons.
    pub choice: Choice,
}

/// A finished recipe.
#[derive(Debug)]
pub struct TaughtRecipe {
    /// The file.
    pub bytes: Vec<u8>,
    /// Its manifest.
    pub manifest: RecipeFile,
    /// Its checked form.
    pub recipe: Recipe,
    /// The production sequence, with the reasons.
    pub choice: Choice,
}

impl UnsealedRecipe {
    /// What is said of recipes whose cycles begin with two frames.
    pub(crate) const TWO_FRAMES: &str = "2 frames are tried first, the sequence taken follows in the same cycle where they do not hold";

    /// What is said of recipes with gauges of contours.
    pub(crate) const CONTOURS: &str =
        "contours need three shifts or more: cycles do not begin with two frames";

    /// The same recipe, whose cycles begin with two frames.
    #[must_use]
    pub fn with_two_frames(mut self) -> Self {
        self.manifest.two_frames = true;
        self.choice.reasons.push(Self::TWO_FRAMES.into());
        self
    }

    /// Packs it.
    ///
    /// # Errors
    /// In words, if it could not be packed, or not be loaded again.
    pub fn seal(self) -> Result<TaughtRecipe, Refusal> {
        self.seal_telling(Headway::silent())
    }

    /// As [`Self::seal`], telling how far it is.
    ///
    /// # Errors
    /// As [`Self::seal`].
    pub fn seal_telling(self, headway: Headway<'_>) -> Result<TaughtRecipe, Refusal> {
        let Self {
            manifest,
            arrays,
            choice,
        } = self;
        let packing = headway.part(0.0, 0.8);
        let (bytes, _) = archive::pack_telling(&manifest, &arrays, packing)?;
        headway.done(0.8);
        // Read back as after a restart, so that what was made is known to load.
        let manifest = archive::manifest(Cursor::new(&bytes))?;
        let recipe = Recipe::check(&manifest, arrays)?;
        Ok(TaughtRecipe {
            bytes,
            manifest,
            recipe,
            choice,
        })
    }
}

impl GoldenPart<'_> {
    /// Makes the recipe: expansion of the height, phase reach (from which follows where a short
    /// sequence is safe), sequences, features and gauges. The gauges are the deviation from golden
    /// and the coverage of the whole frame, and, for each of the up to 8 largest openings of the
    /// part that have 60 pixels and room for a region, the coverage of the opening.
    ///
    /// # Errors
    /// If the recipe does not fit the head, or good parts would not keep the limit that is asked for.
    pub fn recipe(
        mut self,
        naming: &Naming,
        headway: Headway<'_>,
    ) -> Result<UnsealedRecipe, TeachError> {
        // A highlight is not resolved either, but it is no opening: it moves over the part.
        let seen = |trust: &Trust| matches!(trust, Trust::Resolved | Trust::Saturated);
        let seen: Vec<bool> = self.phases.trust.iter().map(seen).collect();
        let (features, gauges) = gauges(&seen, self.phases.width);
        let surface = KnownSurface {
            width: self.phases.width,
            phase: self.phases.phase.clone(),
            height: self.heights.height.clone(),
        };
        let mut arrays = self.arrays(
            &surface,
            naming.placement_tolerance_mm,
            headway.part(0.0, 0.1),
        );
        let sequences = self.sequences(&arrays, headway.part(0.1, 0.2));
        self.release();
        let choice = planner::choose(&sequences, &gauges, 0);
        let range = self.triangulator.range();
        let calibration = self.calibration;
        let (width, height, bit_depth) = calibration.frames();
        let (columns, rows) = calibration.raster();
        let surroundings = self.surroundings.as_ref();
        let mut manifest = RecipeFile {
            format: FORMAT.into(),
            version: VERSION,
            fingerprint: String::new(),
            number: naming.number,
            part_number: naming.part_number.clone(),
            name: naming.name.clone(),
            taught_by: naming.taught_by.clone(),
            taught_at_unix_s: naming.taught_at_unix_s,
            calibration: calibration.fingerprint(),
            camera: CameraFile {
                width,
                height,
                bit_depth,
            },
            projector: RasterFile {
                width: columns,
                height: rows,
            },
            pattern: self.pattern.clone(),
            sequences,
            production: choice.production,
            two_frames: false,
            placement_tolerance_mm: naming.placement_tolerance_mm,
            alignment: AlignmentKind::Rigid,
            range_mm: [range.low, range.high],
            exposing: calibration.exposing,
            exposures: self.illumination.exposures,
            noise_counts: calibration.noise_counts,
            read_noise_counts: self.noise.read_counts(),
            shot_noise: self.noise.shot(),
            golden_offset_counts: self.offset_counts,
            golden_captures: self.captures,
            least_modulation: self.decoder.least_modulation().eight_bit(),
            models: ModelsFile::of(calibration),
            light_edges: self.light_edges,
            calibration_sigma: calibration.sigma,
            everything: naming.everything,
            marking: naming.marking.clone(),
            surroundings_mm: surroundings.and_then(|found| Some(found.step_mm? / 2.0)),
            ground_mm: surroundings.and_then(|found| found.ground),
            expansion_range_turns: EXPANSION_TURNS,
            min_coverage: MIN_COVERAGE,
            judges_nothing: false,
            guard_k: GUARD_K,
            features,
            datums: Vec::new(),
            gauges,
            comparison: self.comparison.clone(),
            good_parts: None,
            tried: Vec::new(),
        };
        let mut words = self.set_limits(
            surface,
            &mut manifest,
            &mut arrays,
            naming.limit_mm,
            headway.part(0.2, 0.95),
        )?;
        // The smaller the squares, the less noise is allowed.
        let widest = arrays.widest();
        let mut choice = planner::choose(&manifest.sequences, &manifest.gauges, widest);
        manifest.production = choice.production;
        choice.reasons.append(&mut words);
        choice
            .reasons
            .extend(self.surroundings.as_ref().map(part::words));
        Ok(UnsealedRecipe {
            manifest,
            arrays,
            choice,
        })
    }

    /// Frees what the recipe's arrays hold as well: 40 MB at 1456 × 1088 pixels.
    fn release(&mut self) {
        self.phases.phase = Vec::new();
        (self.heights.height, self.heights.sigma) = (Vec::new(), Vec::new());
        self.signal = Vec::new();
        self.offsets
            .iter_mut()
            .for_each(|of| *of = Offsets::default());
    }

    fn arrays(
        &self,
        surface: &KnownSurface,
        placement_tolerance_mm: f64,
        headway: Headway<'_>,
    ) -> Arrays {
        let (phases, heights) = (&self.phases, &self.heights);
        let width = phases.width;
        let resolved = |at: usize| phases.trust[at] == Trust::Resolved;
        let mut expansions = vec![[f32::NAN; 2]; phases.phase.len()];
        let rows = phases.phase.len() / width.max(1);
        let expanded = |share| headway.done(0.8 * share);
        let done = pipeline::Done::new(&expanded, rows);
        pipeline::for_each_row(&mut expansions, width, |v, row| {
            for (u, [first, second]) in row.iter_mut().enumerate() {
                let at = v * width + u;
                let (phase, height) = (phases.phase[at].turns(), heights.height[at].mm());
                let expansion = resolved(at)
                    .then(|| self.triangulator.expand(u as f64, v as f64, phase, height))
                    .flatten();
                if let Some(expansion) = expansion {
                    (*first, *second) = (expansion.first as f32, expansion.second as f32);
                }
            }
            done.row();
        });
        let certain = |at: usize| resolved(at) && f64::from(heights.sigma[at]) <= MAX_SIGMA_MM;
        let certain: Vec<bool> = (0..phases.phase.len()).map(certain).collect();
        let full_scale = self.decoder.full_scale();
        let function = self.triangulator.function();
        let turns = |at: usize| {
            if resolved(at) {
                phases.phase[at].turns()
            } else {
                f64::NAN
            }
        };
        Arrays {
            phase_function: match self.pattern {
                PatternFile::File => function.turns().into(),
                PatternFile::Vertical { .. } | PatternFile::Horizontal { .. } => [].into(),
            },
            golden_phase: (0..phases.phase.len()).map(turns).collect(),
            golden_height: heights
                .height
                .iter()
                .map(|height| height.mm() as f32)
                .collect(),
            height_slope: expansions.iter().map(|[first, _]| *first).collect(),
            height_curvature: expansions.iter().map(|[_, second]| *second).collect(),
            valid: eroded(&certain, width, EROSION_PX)
                .into_iter()
                .map(u8::from)
                .collect(),
            modulation: phases
                .modulation
                .iter()
                .map(|modulation| modulation.counts(full_scale) as f32)
                .collect(),
            phase_reach: phase_reach(&self.triangulator, surface, placement_tolerance_mm).into(),
            sequence_offset: self.offsets.iter().flat_map(mean).collect(),
            amplitude: self.illumination.amplitude.as_slice().into(),
            smoothing: [].into(),
            golden_signal: self.signal.as_slice().into(),
        }
    }
}

/// The mean of both.
fn mean(offsets: &Offsets) -> impl Iterator<Item = i16> + '_ {
    let [first, second] = offsets;
    first.iter().zip(second).map(|(a, b)| a.midpoint(*b))
}

/// The features and gauges of a part that is seen by these pixels: those of the whole frame, and
/// those of its openings.
fn gauges(seen: &[bool], width: usize) -> (Vec<FeatureFile>, Vec<GaugeFile>) {
    let rows = seen.len() / width.max(1);
    let (right, bottom) = (width as f64 - 0.5, rows as f64 - 0.5);
    let frame = vec![[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]];
    let mut features = vec![FeatureFile::surface("frame", frame)];
    let smoothing_px = SIDES[SIDES.len() - 1];
    let mut gauges = vec![
        GaugeFile {
            low: Some(-DEVIATION_MM),
            high: Some(DEVIATION_MM),
            ..GaugeFile::new(1, "deviation", Measure::of_shape(smoothing_px), &["frame"])
        },
        GaugeFile {
            low: Some(0.0),
            ..GaugeFile::new(2, "coverage", Measure::of_seen(), &["frame"])
        },
    ];
    let found = openings(seen, width, OPENING_PIXELS);
    let usable = found
        .iter()
        .filter(|opening| opening.reach >= OPENING_REACH);
    for (number, opening) in (1..).zip(usable.take(MAX_OPENINGS)) {
        let name = format!("opening {number}");
        let ((u, v), reach) = (opening.centre, opening.reach as f64);
        let diamond = [
            [u - reach, v],
            [u, v - reach],
            [u + reach, v],
            [u, v + reach],
        ];
        features.push(FeatureFile::surface(&*name, diamond.to_vec()));
        gauges.push(GaugeFile {
            high: Some(OPENING_COVERAGE),
            ..GaugeFile::new(2 + number, &name, Measure::of_seen(), &[&name])
        });
    }
    (features, gauges)
}
