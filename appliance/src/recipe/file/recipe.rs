//! From the file form of a recipe to a checked one.

use super::GoodPartsFile;
use super::archive::{Arrays, short, unpack};
use super::refusal::refused;
use crate::head::calibration::Calibration;
use crate::head::exposing::Exposing;
use crate::recipe::{Demands, GaugeFile, PatternFile, RecipeFile, Refusal, SequenceKind};
use algo::calibration::LENGTH;
use algo::frame::SampleNoise;
use algo::inspect::{CalibrationUncertainty, Feature, Gauge};
use algo::pattern::{PhaseFunction, Sequence, Shot};
use algo::phase::LeastModulation;
use algo::units::Modulation;
use std::io::{Cursor, Read, Seek};

/// Most different sides of squares of one recipe, with 0 where any will do: each takes time in
/// every cycle.
const MAX_SIDES: usize = 5;

/// A recipe whose parts fit each other, parsed into what planning and measuring need.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// What it is called.
    pub id: RecipeId,
    /// How its part is measured.
    pub conditions: Conditions,
    /// What it demands of a part.
    pub demands: Demands,
    /// Φ_P.
    pub function: PhaseFunction,
    /// The sequences that a part is measured with in turn, until one is good enough: the one for
    /// production, and behind it those that unwrap further.
    pub sequences: Vec<RecipeSequence>,
    /// What is found on a part.
    pub features: Vec<Feature>,
    /// What its gauges measure of these features.
    pub gauges: Vec<Gauge>,
    /// The arrays, each of the size of the camera's frames or the projector's raster.
    pub arrays: Arrays,
}

/// What a recipe is called, and which calibration it was made for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecipeId {
    /// 1–9999.
    pub number: u16,
    /// The key that a PLC may select by.
    pub part_number: String,
    /// For people.
    pub name: String,
    /// SHA-256, 64 hexadecimal digits.
    pub fingerprint: String,
    /// Fingerprint of the calibration that it was made for.
    pub calibration: String,
}

/// How a part is measured: the head that the recipe was made on, and what it was set to.
#[derive(Clone, Debug, PartialEq)]
pub struct Conditions {
    /// Columns, rows and bits of the camera's frames.
    pub camera: (u32, u32, u8),
    /// Columns and rows of the projector's raster.
    pub raster: (u32, u32),
    /// How Φ_P is given.
    pub pattern: PatternFile,
    /// Working range of z in mm.
    pub range_mm: [f64; 2],
    /// What the camera was set to, where that is known.
    pub exposing: Option<Exposing>,
    /// Each frame is exposed so many times as long as the head is set to.
    pub exposures: u32,
    /// σ of one sample in counts, at half the light of white.
    pub noise_counts: f64,
    /// The noise of one sample by golden's modulation of its pixel.
    pub noise: SampleNoise,
    /// Captures that golden is the mean of.
    pub golden_captures: usize,
    /// Median of the mean samples over golden's surface, counts; none where it is not known.
    pub golden_offset_counts: Option<f64>,
    /// The least modulation that is trusted.
    pub least_modulation: LeastModulation,
    /// Whether pixels are refused beside which light changes steeply.
    pub light_edges: bool,
    /// σ by the uncertainty of the calibration; 0 where it is not known.
    pub calibration: CalibrationUncertainty,
    /// |ΔΦ| in turns up to which the expansion of the height holds.
    pub expansion_range_turns: f64,
    /// How far behind golden's heights the surroundings begin, mm; `None` if there are none.
    pub surroundings_mm: Option<f64>,
    /// The plane that the part lies on: z at x = y = 0, mm, and its rise along x and y.
    pub ground_mm: Option<[f64; 3]>,
    /// What is known of good parts' deviations.
    pub good_parts: Option<GoodPartsFile>,
}

/// A sequence that a part is measured with.
#[derive(Clone, Debug)]
pub struct RecipeSequence {
    /// What it can unwrap.
    pub kind: SequenceKind,
    /// What each frame shows.
    pub shots: Vec<Shot>,
    /// The levels of these shots.
    pub levels: Sequence,
    /// Which part of `sequence_offset.npy` belongs to the sequence; the full sequence and the two
    /// frames have none.
    pub offset: Option<usize>,
    /// RMS of the periodic error of mean heights, mm.
    pub ripple_mm: f64,
}

impl RecipeSequence {
    /// Whether it is two frames, which are compared with golden's picture.
    pub fn is_pair(&self) -> bool {
        self.kind == SequenceKind::TwoFrames
    }

    /// The fundamental of the finest level's waveform, relative to a sine's.
    pub fn fundamental(&self) -> f64 {
        let finest = self.levels.levels().last();
        finest.map_or(1.0, |level| level.waveform.fundamental())
    }
}

impl Recipe {
    /// Reads and checks a recipe file's bytes.
    ///
    /// # Errors
    /// In words, with the remedy: it is broken, of another version, changed, or inconsistent.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        Self::read(Cursor::new(bytes), bytes.len() as u64)
    }

    /// As [`Self::from_bytes`], from a file of `size` bytes that is not read into memory as a
    /// whole.
    ///
    /// # Errors
    /// As above.
    pub fn read(source: impl Read + Seek, size: u64) -> Result<Self, Refusal> {
        let (file, recipe) = Self::read_to_edit(source, size)?;
        file.check_judging()?;
        Ok(recipe)
    }

    /// As [`Self::read`], with the manifest and without checking whether it can judge: an edit may
    /// be about to correct them.
    ///
    /// # Errors
    /// As above.
    pub(crate) fn read_to_edit(
        source: impl Read + Seek,
        size: u64,
    ) -> Result<(RecipeFile, Self), Refusal> {
        let (file, arrays) = unpack(source, size)?;
        let recipe =
            Self::fit(&file, arrays).map_err(|error| format!("{error}: teach it again"))?;
        Ok((file, recipe))
    }

    /// Golden's modulation by one of the sequences.
    pub(crate) fn light(&self, sequence: usize) -> Vec<Modulation> {
        let (_, _, bit_depth) = self.conditions.camera;
        let full_scale = f64::from((1_u32 << bit_depth) - 1);
        let fundamental = |of: Option<&RecipeSequence>| of.map_or(1.0, |of| of.fundamental());
        let (own, taught) = (self.sequences.get(sequence), self.sequences.last());
        let unit = f64::from(u16::MAX) / full_scale * fundamental(own) / fundamental(taught);
        let bits = |counts: &f32| (f64::from(*counts) * unit).round() as u16;
        let counts = self.arrays.modulation.iter();
        counts
            .map(|counts| Modulation::from_bits(bits(counts)))
            .collect()
    }

    /// Checks that manifest and arrays fit each other, and that the recipe can judge.
    ///
    /// # Errors
    /// In words: what does not fit.
    pub fn check(file: &RecipeFile, arrays: Arrays) -> Result<Self, Refusal> {
        file.check_judging()?;
        Self::fit(file, arrays)
    }

    /// As [`Self::check`], without checking whether it can judge.
    ///
    /// # Errors
    /// In words: what does not fit.
    pub(crate) fn fit(file: &RecipeFile, arrays: Arrays) -> Result<Self, Refusal> {
        file.check_bounds()?;
        let (width, height) = (file.camera.width as usize, file.camera.height as usize);
        let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0);
        // Arrays of the projector's size are checked below.
        let of_projector = ["phase_function", "amplitude"];
        let lengths = arrays.lengths().into_iter();
        for (name, length) in lengths.filter(|(name, _)| !of_projector.contains(name)) {
            let maps = match name {
                "sequence_offset" => file.sequences.len() - 1,
                // Its real and imaginary parts.
                "golden_signal" => 2,
                _ => 1,
            };
            let expected = pixels.and_then(|pixels| pixels.checked_mul(maps));
            let optional = ["sequence_offset", "smoothing", "golden_signal"].contains(&name);
            if Some(length) != expected && !(optional && length == 0) {
                return refused!(
                    "{name} has {length} values for a camera of {width}x{height} and {} sequences",
                    file.sequences.len()
                );
            }
        }
        let (columns, rows) = (
            file.projector.width as usize,
            file.projector.height as usize,
        );
        let amplitude = &arrays.amplitude;
        let is_whole = file.exposures == 1 && amplitude.is_empty();
        if !is_whole && (amplitude.len() != columns * rows || amplitude.contains(&0)) {
            return refused!(
                "amplitude has {} values, {} of them 0, for a projector of {columns}x{rows} and {} exposures: it has one of 1 to 255 for each pixel, or with one exposure none",
                amplitude.len(),
                amplitude.iter().filter(|share| **share == 0).count(),
                file.exposures
            );
        }
        let mut sides = arrays.smoothing.to_vec();
        sides.sort_unstable();
        sides.dedup();
        if sides.len() > MAX_SIDES || sides.iter().any(|&side| side > 0 && side % 2 == 0) {
            return refused!(
                "smoothing has {} different values: it has at most {MAX_SIDES}, 0 or odd, as squares have a middle pixel",
                sides.len()
            );
        }
        let function = match file.pattern {
            PatternFile::Vertical { fringes } => PhaseFunction::vertical(columns, rows, fringes),
            PatternFile::Horizontal { fringes } => {
                PhaseFunction::horizontal(columns, rows, fringes)
            }
            PatternFile::File => {
                PhaseFunction::sampled(columns, rows, arrays.phase_function.to_vec())
            }
        };
        let function = function.map_err(|error| format!("projector and pattern: {error}"))?;
        file.head()?;
        let features = file.features.iter();
        let features = features.map(|of| of.checked(&file.features, (width, height)));
        Ok(Self {
            sequences: sequences(file)?,
            features: features.collect::<Result<_, _>>()?,
            gauges: gauges(file),
            id: file.into(),
            conditions: file.into(),
            demands: file.into(),
            function,
            arrays,
        })
    }
}

/// The sequence for production, and behind it those that unwrap further than the one before.
fn sequences(file: &RecipeFile) -> Result<Vec<RecipeSequence>, Refusal> {
    let mut chain: Vec<RecipeSequence> = Vec::new();
    if file.two_frames {
        chain.push(RecipeSequence {
            kind: SequenceKind::TwoFrames,
            shots: Shot::level(1.0, 2).collect(),
            levels: Sequence::pair(),
            offset: None,
            ripple_mm: file
                .sequences
                .last()
                .and_then(|full| full.ripple_mm)
                .unwrap_or(0.0),
        });
    }
    let last = file.sequences.len() - 1;
    for (at, sequence) in file.sequences.iter().enumerate().skip(file.production) {
        if chain
            .last()
            .is_none_or(|before| before.kind < sequence.kind)
        {
            chain.push(RecipeSequence {
                kind: sequence.kind,
                shots: sequence.frames.clone(),
                levels: Sequence::from_frames(&sequence.frames)?,
                offset: (at < last).then_some(at),
                ripple_mm: sequence.ripple_mm.unwrap_or(0.0),
            });
        }
    }
    Ok(chain)
}

/// The gauges that are computed; their features were checked to be there.
fn gauges(file: &RecipeFile) -> Vec<Gauge> {
    let place = |name: &String| {
        file.features
            .iter()
            .position(|feature| feature.name == *name)
    };
    let datum = |name: &String| file.datums.iter().find(|datum| datum.name == *name);
    let gauge = |gauge: &GaugeFile| Gauge {
        of: gauge.of.iter().filter_map(place).collect(),
        datum: match gauge.datum.as_ref().and_then(datum) {
            Some(datum) => datum.of.iter().filter_map(place).collect(),
            None => Vec::new(),
        },
        measure: gauge.measures.clone(),
    };
    file.gauges.iter().map(gauge).collect()
}

impl RecipeId {
    /// First 32 bits of the fingerprint.
    pub fn crc(&self) -> u32 {
        short(&self.fingerprint)
    }
}

impl From<&RecipeFile> for RecipeId {
    fn from(file: &RecipeFile) -> Self {
        Self {
            number: file.number,
            part_number: file.part_number.clone(),
            name: file.name.clone(),
            fingerprint: file.fingerprint.clone(),
            calibration: file.calibration.clone(),
        }
    }
}

impl Conditions {
    /// The exposure and gain that the recipe was taught with and those that the head is set to, if
    /// they differ: then the recipe's noise is not the head's.
    pub fn set_otherwise(&self, head: &Calibration) -> Option<[Exposing; 2]> {
        let (taught, present) = self.exposing.zip(head.exposing)?;
        (!taught.agrees(&present)).then_some([taught, present])
    }
}

impl From<&RecipeFile> for Conditions {
    fn from(file: &RecipeFile) -> Self {
        let (camera, projector) = (&file.camera, &file.projector);
        Self {
            camera: (camera.width, camera.height, camera.bit_depth),
            raster: (projector.width, projector.height),
            pattern: file.pattern.clone(),
            range_mm: file.range_mm,
            exposing: file.exposing,
            exposures: file.exposures,
            noise_counts: file.noise_counts,
            noise: SampleNoise::new(file.read_noise_counts, file.shot_noise),
            golden_captures: file.golden_captures,
            golden_offset_counts: file.golden_offset_counts,
            least_modulation: LeastModulation::new(file.least_modulation).unwrap_or_default(),
            light_edges: file.light_edges,
            calibration: file.calibration_sigma.map_or_else(
                CalibrationUncertainty::default,
                |sigma| CalibrationUncertainty {
                    height: sigma.height_mm,
                    length: sigma.length_mm / LENGTH,
                },
            ),
            expansion_range_turns: file.expansion_range_turns,
            surroundings_mm: file.surroundings_mm,
            ground_mm: file.ground_mm,
            good_parts: file.good_parts,
        }
    }
}
