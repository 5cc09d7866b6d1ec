//! Makes a recipe from a golden measurement, which comes from a head or from a recording.

use super::archive::{self, Arrays};
use super::captures::Offsets;
use super::comparison::ComparisonFile;
use super::file::{CameraFile, FORMAT, RasterFile, VERSION};
use super::good_parts::{GoodPartsFile, Noise, ROOM, SIDES};
use super::planner::{self, Choice};
use super::proof::{self, Magnitudes};
use super::{
    AlignmentKind, GaugeFile, GaugeKind, PatternFile, Recipe, RecipeFile, RegionFile, SequenceFile,
};
use crate::head::calibration::Calibration;
use crate::head::rasters::Illumination;
use crate::station::{Inspection, MAX_GAUGES};
use algo::adaptive::phase_reach;
use algo::frame::SampleNoise;
use algo::geometry::Triangulator;
use algo::inspect::{eroded, openings};
use algo::pattern::Shot;
use algo::phase::{Decoder, Trust};
use algo::pipeline::{self, HeightMap, KnownSurface, PhaseMap};
use std::io::Cursor;

/// The area where deviations are compared is eroded by this many pixels on each side: pixels at silhouettes mix two surfaces.
const EROSION_PX: usize = 2;
/// Pixels whose taught height is less certain than this are not compared, mm (1 σ).
const MAX_SIGMA_MM: f64 = 0.25;
/// Requested tolerance of the deviation, ± mm. It becomes the gauge's limit if the part can be measured that well, else the limit is
/// wider: see [`super::good_parts`].
const DEVIATION_MM: f64 = 0.15;
/// The coverage of a good part may be lower than expected by this share of the frame. Noise alone causes less: of 200,000 pixels
/// that are all just at the least trusted modulation, the number of resolved ones has σ = √200,000 / 2, and 6 σ of the difference
/// of two such numbers is 1,900, or 0.7 % of a frame of only 512 × 512 pixels.
pub(super) const COVERAGE_CHANGE: f64 = 0.01;
/// Least share of the golden surface that must be resolved.
const MIN_COVERAGE: f64 = 0.80;
/// The deviation of a good part is taken to lie at most this many scatters above its mean: of placements that are worked out.
const FARTHEST: f64 = 4.0;
/// Guard bands of new recipes: with k = 1.65 one in 20 parts that lie just outside of a limit would pass (ISO 14253-1:2017), with 2
/// one in 44.
const GUARD_K: f64 = 2.0;
/// An opening has at least this many pixels.
const OPENING_PIXELS: usize = 60;
/// At most this share of an opening's region may be resolved on a good part.
const OPENING_COVERAGE: f64 = 0.25;
/// At most this many openings get a gauge, the largest ones.
const MAX_OPENINGS: usize = 8;
/// Half the diagonals of an opening's region, an upright diamond, are at least this many pixels long.
const OPENING_REACH: usize = 4;
/// |ΔΦ| up to which the expansion of the height is used, turns.
const EXPANSION_TURNS: f64 = 0.5;

/// Names of a recipe, its placement tolerance and its exposures.
#[derive(Clone, Debug)]
pub struct Naming {
    /// 1–9999.
    pub number: u16,
    /// The key for a PLC.
    pub part_number: String,
    /// For people.
    pub name: String,
    /// When, in seconds since 1970 UTC; 0 if not known.
    pub taught_at_unix_s: u64,
    /// How far any corner of a part may lie from where it was taught, mm.
    pub placement_tolerance_mm: f64,
    /// Each frame is exposed so many times as long as the head is set to, 1 to 4.
    pub exposures: u32,
}

/// A measured golden part.
pub struct GoldenPart<'a> {
    /// The head's calibration.
    pub calibration: &'a Calibration,
    /// The pattern's file form; the function itself is the triangulator's.
    pub pattern: PatternFile,
    /// The light with which it was measured.
    pub illumination: Illumination,
    /// What each frame of the full sequence shows.
    pub full: &'a [Shot],
    /// How these frames were decoded.
    pub decoder: &'a Decoder,
    /// The geometry with its phase function.
    pub triangulator: &'a Triangulator,
    /// Golden phase of each camera pixel, with its modulation and trust.
    pub phases: &'a PhaseMap,
    /// Golden height of each camera pixel, with the σ of one capture.
    pub heights: &'a HeightMap,
    /// The difference from this phase by each of the other sequences, in their order; none if they were not measured.
    pub offsets: &'a [Offsets],
    /// The noise of a sample by the modulation of its pixel in one capture.
    pub noise: SampleNoise,
    /// Captures that all of this is the mean of; σ is that of one.
    pub captures: usize,
    /// Fixed against adaptive pattern, if a fixed one was measured as well.
    pub comparison: Option<ComparisonFile>,
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

impl TaughtRecipe {
    /// Chooses the production sequence for the gauges of a manifest, and packs it with its arrays.
    ///
    /// # Errors
    /// In words, if they do not fit each other.
    pub(super) fn of(mut manifest: RecipeFile, arrays: Arrays) -> Result<Self, String> {
        let choice = planner::choose(&manifest.sequences, &manifest.gauges);
        manifest.production = choice.production;
        let mut recipe = Recipe::check(&manifest, arrays)?;
        let (bytes, fingerprint) = archive::pack(&manifest, &recipe.arrays)?;
        recipe.id.fingerprint.clone_from(&fingerprint);
        manifest.fingerprint = fingerprint;
        Ok(Self {
            bytes,
            manifest,
            recipe,
            choice,
        })
    }
}

impl TaughtRecipe {
    /// The same recipe, whose cycles begin with two frames.
    ///
    /// # Errors
    /// In words, if it could not be packed.
    pub fn with_two_frames(mut self) -> Result<Self, String> {
        self.manifest.two_frames = true;
        self.choice.reasons.push(
            "2 frames are tried first, the sequence taken follows in the same cycle where they do not hold".into(),
        );
        let mut recipe = Recipe::check(&self.manifest, self.recipe.arrays)?;
        let (bytes, fingerprint) = archive::pack(&self.manifest, &recipe.arrays)?;
        recipe.id.fingerprint.clone_from(&fingerprint);
        self.manifest.fingerprint = fingerprint;
        Ok(Self {
            bytes,
            recipe,
            ..self
        })
    }
}

impl GoldenPart<'_> {
    /// Makes the recipe: expansion of the height, phase reach (from which follows where a short sequence is safe), sequences, regions
    /// and gauges. The gauges are the deviation from golden and the coverage of the whole frame, and, for each of the up to
    /// 8 largest openings of the part that have 60 pixels and room for a region, the coverage of the opening.
    ///
    /// # Errors
    /// In words, if the recipe could not be packed, or not be loaded again.
    pub fn recipe(&self, naming: &Naming) -> Result<TaughtRecipe, String> {
        let resolved: Vec<bool> = self
            .phases
            .trust
            .iter()
            .map(|trust| *trust == Trust::Resolved)
            .collect();
        let (regions, gauges) = gauges(&resolved, self.phases.width);
        let surface = KnownSurface {
            width: self.phases.width,
            phase: self.phases.phase.clone(),
            height: self.heights.height.clone(),
        };
        let mut arrays = self.arrays(&surface, naming.placement_tolerance_mm);
        let sequences = self.sequences(&arrays);
        let choice = planner::choose(&sequences, &gauges);
        let range = self.triangulator.range();
        let calibration = self.calibration;
        let (width, height, bit_depth) = calibration.frames();
        let (columns, rows) = calibration.raster();
        let mut manifest = RecipeFile {
            format: FORMAT.into(),
            version: VERSION,
            fingerprint: String::new(),
            number: naming.number,
            part_number: naming.part_number.clone(),
            name: naming.name.clone(),
            taught_by: concat!("fringed ", env!("CARGO_PKG_VERSION")).into(),
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
            // Heads take their exposure from the configuration.
            exposure_us: None,
            exposures: self.illumination.exposures,
            noise_counts: calibration.noise_counts,
            read_noise_counts: Some(self.noise.read_counts()),
            shot_noise: Some(self.noise.shot()),
            golden_captures: self.captures,
            least_modulation: Some(self.decoder.least_modulation().eight_bit()),
            calibration_sigma: calibration.sigma,
            expansion_range_turns: EXPANSION_TURNS,
            min_coverage: MIN_COVERAGE,
            guard_k: GUARD_K,
            regions,
            gauges,
            comparison: self.comparison.clone(),
            good_parts: None,
        };
        let mut words = self.set_limits(surface, &mut manifest, &mut arrays)?;
        // The smaller the squares, the less noise is allowed.
        let mut choice = planner::choose(&manifest.sequences, &manifest.gauges);
        manifest.production = choice.production;
        choice.reasons.append(&mut words);
        let (bytes, _) = archive::pack(&manifest, &arrays)?;
        drop(arrays);
        // Read back as after a restart, so that what was taught is known to load.
        let (manifest, arrays) = archive::unpack(Cursor::new(&bytes), bytes.len() as u64)?;
        let recipe = Recipe::check(&manifest, arrays)?;
        Ok(TaughtRecipe {
            bytes,
            manifest,
            recipe,
            choice,
        })
    }

    fn arrays(&self, surface: &KnownSurface, placement_tolerance_mm: f64) -> Arrays {
        let (phases, heights) = (self.phases, self.heights);
        let width = phases.width;
        let resolved = |at: usize| phases.trust[at] == Trust::Resolved;
        let mut expansions = vec![[f32::NAN; 2]; phases.phase.len()];
        pipeline::for_each_row(&mut expansions, width, |v, row| {
            for (u, [first, second]) in row.iter_mut().enumerate() {
                let at = v * width + u;
                let phase = phases.phase[at].turns();
                let expansion = resolved(at)
                    .then(|| self.triangulator.expand(u as f64, v as f64, phase))
                    .flatten();
                if let Some(expansion) = expansion {
                    (*first, *second) = (expansion.first as f32, expansion.second as f32);
                }
            }
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
                PatternFile::File => function.turns(),
                PatternFile::Vertical { .. } | PatternFile::Horizontal { .. } => Vec::new(),
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
            phase_reach: phase_reach(self.triangulator, surface, placement_tolerance_mm),
            sequence_offset: self.offsets.iter().flat_map(mean).collect(),
            amplitude: self.illumination.amplitude.clone(),
        }
    }

    /// Sets the squares and the limits of the gauges by what good parts are predicted to read, wherever they lie within the placement tolerance;
    /// overwrites `arrays.valid` (0 or 1) with the weights of the pixels. Returns what to say of it.
    fn set_limits(
        &self,
        surface: KnownSurface,
        manifest: &mut RecipeFile,
        arrays: &mut Arrays,
    ) -> Result<Vec<String>, String> {
        let (sequences, production) = (&manifest.sequences, manifest.production);
        let expected = sequences[production..].iter();
        let expected = expected.filter_map(|of| self.expected_coverage(of, &arrays.phase_reach));
        let coverage = expected.fold(f64::INFINITY, f64::min) - COVERAGE_CHANGE;
        let noise = self.noise(surface, arrays, sequences, production);
        let compared = arrays.valid.clone();
        let mut good_parts = noise.weigh_smallest(&mut arrays.valid, DEVIATION_MM, &SIDES);
        for gauge in &mut manifest.gauges {
            match gauge.measures {
                GaugeKind::Deviation { .. } => set_deviation(gauge, &good_parts),
                // Of the whole frame; openings have an upper limit.
                GaugeKind::Coverage => gauge.low = gauge.low.map(|_| coverage.max(0.0)),
                _ => {}
            }
        }
        // The same deviation in squares of all sides that may be taken.
        let sides = SIDES
            .into_iter()
            .filter(|side| *side >= good_parts.smoothing_px);
        let sides: Vec<usize> = sides.collect();
        let mut tried = manifest.clone();
        let room = MAX_GAUGES.saturating_sub(tried.gauges.len());
        for side in sides.iter().skip(1).take(room) {
            let mut gauge = tried.gauges[0].clone();
            gauge.name = format!("{} in {side}", gauge.name);
            gauge.measures = GaugeKind::Deviation {
                smoothing_px: *side,
            };
            tried.gauges.push(gauge);
        }
        let judged = proof::displaced(&tried, arrays, self.calibration)?;
        let others = manifest.gauges.len() - 1;
        let gauge_of = |at: usize| if at == 0 { 0 } else { at + others };
        let found = |at: usize| Magnitudes::of(&judged, gauge_of(at));
        let fits = |of: Magnitudes| of.middle + FARTHEST * of.spread < ROOM * good_parts.limit_mm;
        let at = (0..sides.len()).find(|at| found(*at).is_none_or(fits));
        let at = at.unwrap_or(sides.len() - 1);
        if at > 0 {
            arrays.valid = compared;
            good_parts = noise.weigh_smallest(&mut arrays.valid, DEVIATION_MM, &sides[at..=at]);
            set_deviation(&mut manifest.gauges[0], &good_parts);
        }
        let taken = found(at);
        if let Some(Magnitudes { middle, spread }) = taken {
            (good_parts.displaced_mm, good_parts.displaced_scatter_mm) = (middle, spread);
        }
        let mut words = good_parts.words();
        manifest.good_parts = Some(good_parts);
        // Values by the squares that were taken, in the order of the recipe's gauges.
        let judged = judged.into_iter().filter_map(|mut inspection| {
            let deviation = inspection.gauges.get(gauge_of(at)).cloned()?;
            let wrong = taken.zip(deviation.value);
            if wrong.is_some_and(|(of, value)| of.is_wrong(value)) {
                return None;
            }
            inspection.gauges[0] = deviation;
            inspection.gauges.truncate(others + 1);
            Some(inspection)
        });
        let judged: Vec<Inspection> = judged.collect();
        words.extend(proof::hold(manifest, &judged));
        Ok(words)
    }

    /// The noise of the part by the sequence that it is measured with first.
    fn noise<'a>(
        &'a self,
        surface: KnownSurface,
        arrays: &Arrays,
        sequences: &[SequenceFile],
        production: usize,
    ) -> Noise<'a> {
        let first = &sequences[production];
        let production = {
            let variance = self.variance(first.kind, &first.frames, arrays);
            (0..arrays.valid.len())
                .map(|at| variance(at) as f32)
                .collect()
        };
        // Golden's phase is that by the first sequence, or by the full one, the last.
        let golden = match sequences.last().filter(|_| self.offsets.is_empty()) {
            Some(full) => (full.sigma_mm / first.sigma_mm.max(f64::MIN_POSITIVE)).powi(2),
            None => 1.0,
        };
        Noise {
            triangulator: self.triangulator,
            surface,
            production,
            golden: golden / self.captures as f64,
        }
    }
}

/// Gives a deviation the squares and the limit of a prediction.
fn set_deviation(gauge: &mut GaugeFile, good_parts: &GoodPartsFile) {
    let limit = good_parts.limit_mm;
    (gauge.low, gauge.high) = (Some(-limit), Some(limit));
    gauge.measures = GaugeKind::Deviation {
        smoothing_px: good_parts.smoothing_px,
    };
}

/// The mean of both.
fn mean(offsets: &Offsets) -> impl Iterator<Item = i16> + '_ {
    let [first, second] = offsets;
    first.iter().zip(second).map(|(a, b)| a.midpoint(*b))
}

/// The regions and gauges of a part with these resolved pixels: those of the whole frame, and those of its openings.
fn gauges(resolved: &[bool], width: usize) -> (Vec<RegionFile>, Vec<GaugeFile>) {
    let rows = resolved.len() / width.max(1);
    let (right, bottom) = (width as f64 - 0.5, rows as f64 - 0.5);
    let mut regions = vec![RegionFile {
        name: "frame".into(),
        polygon: vec![[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]],
    }];
    let mut gauges = vec![
        GaugeFile {
            name: "deviation".into(),
            region: "frame".into(),
            measures: GaugeKind::Deviation {
                smoothing_px: SIDES[SIDES.len() - 1],
            },
            low: Some(-DEVIATION_MM),
            high: Some(DEVIATION_MM),
        },
        GaugeFile {
            name: "coverage".into(),
            region: "frame".into(),
            measures: GaugeKind::Coverage,
            low: Some(0.0),
            high: None,
        },
    ];
    let found = openings(resolved, width, OPENING_PIXELS);
    let usable = found
        .iter()
        .filter(|opening| opening.reach >= OPENING_REACH);
    for (at, opening) in usable.take(MAX_OPENINGS).enumerate() {
        let name = format!("opening {}", at + 1);
        let ((u, v), reach) = (opening.centre, opening.reach as f64);
        regions.push(RegionFile {
            name: name.clone(),
            polygon: vec![
                [u - reach, v],
                [u, v - reach],
                [u + reach, v],
                [u, v + reach],
            ],
        });
        gauges.push(GaugeFile {
            name: name.clone(),
            region: name,
            measures: GaugeKind::Coverage,
            low: None,
            high: Some(OPENING_COVERAGE),
        });
    }
    (regions, gauges)
}
