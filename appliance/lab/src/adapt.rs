//! Makes a pattern for the part of a preliminary recording (`fringed-lab adapt`): its phase function,
//! and with `--patterns` what to project and what to decode the frames with.

use algo::adaptive::noise::Light;
use algo::adaptive::{FringeOptics, ProjectorMap, noise, paper};
use algo::pattern::{Encoder, PhaseFunction, Shot, Split, Waveforms};
use algo::units::AbsolutePhase;
use appliance::error::{Exit, Failure, Result};
use appliance::head::{direction, seam};
use appliance::measure::{measure, wrong};
use appliance::output::grey_png;
use appliance::storage::folder::OutputFolder;
use hal::npy;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// The method and its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptOptions {
    /// The method.
    pub method: PatternMethod,
    /// Blur and smallest pitches. The paper's method uses only the image pitch: its projector pitch
    /// is [`paper::PROJECTOR_PITCH`], and the blur only enters the prediction.
    pub optics: FringeOptics,
}

/// A method of making a pattern for a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PatternMethod {
    /// Peng & Gupta (2008), from vertical and horizontal fringes.
    Paper,
    /// Least error for the light and the contrast that there are, from vertical fringes alone.
    Fringed,
}

/// A phase function that was made for a part.
#[derive(Clone, Debug)]
pub struct Adapted {
    /// Φ_P over the projector's raster.
    pub function: PhaseFunction,
    /// Φ that the preliminary measurement expects in each camera pixel under this pattern, unknown
    /// where it was not resolved.
    pub expected: Vec<AbsolutePhase>,
    /// The summary.
    pub report: AdaptReport,
}

/// The summary of an adaptation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AdaptReport {
    /// The method by which the phase function was made.
    pub method: PatternMethod,
    /// Rows and columns of the phase function: the projector's.
    pub shape: [usize; 2],
    /// Camera pixels whose projector point is known and on the raster.
    pub pixels_used: usize,
    /// Smallest and largest local pitch along ξ over the whole raster, projector pixels.
    pub pitch_px: [f64; 2],
    /// Largest Φ_P in turns; the smallest is 0.
    pub max_turns: f64,
    /// RMS of the preliminary measurement's σ_z, mm; `None` if the noise is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preliminary_sigma_mm: Option<f64>,
    /// RMS of σ_z that is predicted for the new phase function with the levels and shifts of the
    /// preliminary sequence, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_sigma_mm: Option<f64>,
}

/// Measures a preliminary recording and makes a phase function for its part.
///
/// # Errors
/// If it cannot be measured, lacks a pattern or a model that the method needs, or has no resolved
/// pixels.
pub fn adapt(recording: &Recording, folder: &Path, options: &AdaptOptions) -> Result<Adapted> {
    let crossed = crossed(recording, options.method).map_err(wrong(folder))?;
    let measurement = measure(recording, folder)?;
    if direction::word(&recording.patterns[measurement.primary]) != "vertical" {
        return Err(wrong(folder)(
            &"patterns are adapted along the rows of the projector, and its fringes along the columns hardly depend on the height here: stand the projector beside the camera",
        ));
    }
    let decoder = measurement.decoder.as_ref().ok_or_else(|| {
        wrong(folder)("a Gray code alone has no modulation of fringes to go by: record fringes with fringed record")
    })?;
    let surface = measurement.heights.as_ref().map_err(|missing| {
        wrong(folder)(format!(
            "{missing}: calibrate the head and add both models, or record with fringed record"
        ))
    })?;
    let projector = &recording.projector;
    let (columns, rows) = (projector.width as usize, projector.height as usize);
    let map = match crossed {
        None => ProjectorMap::from_heights(&surface.triangulator, &surface.map),
        Some(Crossed { at, pitch }) => {
            let phases = at.map(|at| &measurement.phases[at].phase[..]);
            ProjectorMap::from_phases(phases, pitch, surface.map.width)
        }
    };
    let spec = &recording.patterns[measurement.primary];
    let before = seam::phase_function(spec, columns, rows).map_err(wrong(folder))?;
    let made = match options.method {
        PatternMethod::Fringed => {
            let slopes = map.slopes(noise::MAX_SLOPE);
            let light = Light::of(
                &measurement.phases[measurement.primary],
                decoder,
                &slopes,
                1.0 / before.pitches()[0],
                &options.optics.blur,
                measurement.report.noise_counts,
                &|_| (),
            );
            noise::adapt(&map, columns, rows, &options.optics, &light, &|_| ())
        }
        PatternMethod::Paper => paper::adapt(&map, columns, rows, options.optics.image_pitch),
    };
    let function = made.map_err(wrong(folder))?;
    let sigmas = noise::predict(
        &surface.map.sigma,
        &map,
        &before,
        &function,
        &options.optics.blur,
    );
    let on_raster = |point: &&[f64; 2]| {
        let inside = |x: f64, count: usize| x > -0.5 && x < count as f64 - 0.5;
        inside(point[0], columns) && inside(point[1], rows)
    };
    let report = AdaptReport {
        method: options.method,
        shape: [rows, columns],
        pixels_used: map.points.iter().filter(on_raster).count(),
        pitch_px: function.pitches(),
        max_turns: function.range().max,
        preliminary_sigma_mm: sigmas.map(|[before, _]| before),
        predicted_sigma_mm: sigmas.map(|[_, after]| after),
    };
    let trusted = match options.method {
        PatternMethod::Fringed => map.without_blurred_silhouettes(options.optics.blur.camera),
        PatternMethod::Paper => map,
    };
    Ok(Adapted {
        expected: trusted.expected_phase(&function),
        function,
        report,
    })
}

/// Vertical and horizontal fringes of a recording.
struct Crossed {
    /// Indices of the vertical and the horizontal pattern.
    at: [usize; 2],
    /// Pitch of each, projector pixels.
    pitch: [f64; 2],
}

/// Checks that a recording has the patterns that a method needs; those of the paper's method are
/// returned. The vertical pattern is the measurement's primary one.
fn crossed(recording: &Recording, method: PatternMethod) -> Result<Option<Crossed>, &'static str> {
    let projector = &recording.projector;
    let find = |pitch: &dyn Fn(&PatternSpec) -> Option<f64>| {
        let mut patterns = recording.patterns.iter().enumerate();
        patterns.find_map(|(at, spec)| pitch(spec).map(|pitch| (at, pitch)))
    };
    let vertical = find(&|spec| match spec {
        PatternSpec::Vertical { fringes } => Some(f64::from(projector.width) / fringes),
        _ => None,
    });
    let horizontal = find(&|spec| match spec {
        PatternSpec::Horizontal { fringes } => Some(f64::from(projector.height) / fringes),
        _ => None,
    });
    match (method, vertical, horizontal) {
        (PatternMethod::Fringed, Some(_), _) => Ok(None),
        (PatternMethod::Paper, Some((vertical, across)), Some((horizontal, down))) => {
            Ok(Some(Crossed {
                at: [vertical, horizontal],
                pitch: [across, down],
            }))
        }
        (PatternMethod::Paper, Some(_), None) => Err(
            "the paper's method needs vertical and horizontal fringes, and the recording has no \
             horizontal pattern: record both, or use --method fringed",
        ),
        (PatternMethod::Paper, None, _) => Err(
            "the paper's method needs vertical and horizontal fringes, and the recording has no \
             vertical pattern: record both",
        ),
        (PatternMethod::Fringed, None, _) => Err(
            "the recording has no vertical pattern, which the heights come from: record one with \
             fringed record",
        ),
    }
}

impl AdaptReport {
    /// The report as lines of a name and a value.
    pub fn table(&self) -> String {
        let [rows, columns] = self.shape;
        let [low, high] = self.pitch_px;
        let mut lines = vec![
            ("phase function", format!("{rows} rows x {columns} columns")),
            ("pixels used", format!("{} px", self.pixels_used)),
            ("local pitch", format!("{low:.2} to {high:.2} px")),
            ("largest phase", format!("{:.3} turns", self.max_turns)),
        ];
        let sigmas = self.preliminary_sigma_mm.zip(self.predicted_sigma_mm);
        if let Some((before, after)) = sigmas {
            let text = format!("{after:.4} mm RMS, was {before:.4} mm with the same levels");
            lines.push(("height noise (1 σ)", text));
        }
        let lines = lines
            .iter()
            .map(|(name, value)| format!("{name:<26}{value}\n"));
        lines.collect()
    }
}

/// Reach of a sequence that can show a wrong fringe order, turns: that of two levels of ratios 1
/// and 4/5. Sequences of fewer frames than two levels need are a single level, which is right
/// within 0.40 turn of the expected phase.
const REACH: f64 = 2.3;
const REACH_OF_ONE: f64 = 0.4;

/// Name and version of `sequence.json`.
const FORMAT: &str = "fringed-sequence";
const VERSION: u32 = 1;
/// Names of the other files.
const PHASE_FUNCTION: &str = "phase_function.npy";
const EXPECTED_PHASE: &str = "expected_phase.npy";

/// The most accurate split of `frames` frames about an expected phase.
pub fn split(frames: usize, waveforms: Waveforms) -> Option<Split> {
    Split::best(frames, REACH, waveforms).or_else(|| Split::best(frames, REACH_OF_ONE, waveforms))
}

/// A sequence of an adapted pattern.
pub struct Projected<'a> {
    function: &'a PhaseFunction,
    /// The expected phase of each camera pixel, row-major in rows of `width`.
    expected: &'a [AbsolutePhase],
    width: usize,
    split: Split,
    shots: Vec<Shot>,
}

/// `sequence.json`.
#[derive(Serialize)]
struct SequenceFile<'a> {
    format: &'a str,
    version: u32,
    frames: Vec<FrameFile>,
    reach_turns: f64,
    unseen_orders: f64,
    phase_function: &'a str,
    expected_phase: &'a str,
}

/// A picture to project, in the words of a recording.
#[derive(Serialize)]
struct FrameFile {
    file: String,
    ratio: f64,
    shift_turns: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    harmonics: Vec<(u8, f64)>,
}

impl<'a> Projected<'a> {
    /// The most accurate sequence of `frames` frames for the pattern, about the phase that is
    /// expected of a camera with rows of `width` pixels.
    ///
    /// # Errors
    /// If there is no sequence of this many frames (64).
    pub fn new(
        adapted: &'a Adapted,
        width: usize,
        frames: usize,
        waveforms: Waveforms,
    ) -> Result<Self> {
        let split = split(frames, waveforms).ok_or_else(|| {
            let words = "frames make no sequence about an expected phase: give 3 to 27";
            Failure::because(Exit::Usage, "--frames", format!("{frames} {words}"))
        })?;
        Ok(Self {
            function: &adapted.function,
            expected: &adapted.expected,
            width,
            shots: split.shots(waveforms),
            split,
        })
    }

    /// The sequence in words, with what it accepts.
    pub fn words(&self) -> String {
        let levels = self.split.levels.iter();
        let levels: Vec<String> = levels
            .map(|(ratio, shifts)| format!("{shifts} of ratio {ratio:.6}"))
            .collect();
        let Split { reach, slips, .. } = self.split;
        let orders = match self.split.levels.len() {
            1 => "a wrong fringe order leaves no residual".to_owned(),
            _ => format!(
                "wrong fringe orders without a residual: {slips:.1e} of the pixels of the least trusted modulation"
            ),
        };
        format!(
            "frames                    {}; right within {reach:.1} turns of the expected phase; {orders}",
            levels.join(" + ")
        )
    }

    /// Writes the folder. Pictures of a longer sequence that was written there before are removed.
    ///
    /// # Errors
    /// If it cannot be written (exit code 73).
    pub fn write(&self, folder: &Path) -> Result<()> {
        let folder = OutputFolder::create(folder)?;
        let file = |at: usize| format!("{at:03}.png");
        let encoder = Encoder::new(None, &self.shots);
        let pictures: Vec<Vec<u8>> = self
            .shots
            .par_iter()
            .map(|&shot| {
                let raster = encoder.raster(self.function, shot);
                grey_png(raster.width, &raster.pixels)
            })
            .collect();
        for (at, picture) in pictures.iter().enumerate() {
            folder.write(&file(at), picture)?;
        }
        let mut beyond = pictures.len();
        while folder.remove(&file(beyond))? {
            beyond += 1;
        }
        let function = npy::write(self.function.columns(), &self.function.turns());
        folder.write(PHASE_FUNCTION, &function)?;
        let turns = |phase: &AbsolutePhase| match phase.is_known() {
            true => phase.turns() as f32,
            false => f32::NAN,
        };
        let expected: Vec<f32> = self.expected.iter().map(turns).collect();
        folder.write(EXPECTED_PHASE, &npy::write(self.width, &expected))?;
        let frames = self.shots.iter().enumerate().map(|(at, shot)| FrameFile {
            file: file(at),
            ratio: shot.ratio,
            shift_turns: shot.shift,
            harmonics: shot.waveform.harmonics().collect(),
        });
        let sequence = SequenceFile {
            format: FORMAT,
            version: VERSION,
            frames: frames.collect(),
            reach_turns: self.split.reach,
            unseen_orders: self.split.slips,
            phase_function: PHASE_FUNCTION,
            expected_phase: EXPECTED_PHASE,
        };
        let json = serde_json::to_string_pretty(&sequence)
            .map_err(Exit::Software.because("write the sequence"))?;
        folder.write("sequence.json", format!("{json}\n").as_bytes())
    }
}
