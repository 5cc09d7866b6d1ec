//! `fringed-lab adapt RECORDING --method paper|fringed --out phase.npy [--patterns DIR]`.

use crate::adapt::{AdaptOptions, PatternMethod, Projected, adapt};
use algo::adaptive::{Blur, FringeOptics, noise, paper};
use algo::pattern::{Waveform, Waveforms};
use appliance::cli::numbers::number;
use appliance::cli::{Output, Threads, names};
use appliance::error::{Exit, Result};
use appliance::storage::folder::OutputFolder;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use hal::npy;
use hal::replay::Recording;
use std::path::{Path, PathBuf};

/// The numbers of frames that a sequence is made for.
fn frames() -> impl TypedValueParser<Value = usize> {
    PossibleValuesParser::new(["24", "12", "9", "6", "5", "4", "3"])
        .try_map(|text| text.parse::<usize>())
}

/// The waveforms of a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Form {
    /// The one with the most modulation.
    Bright,
    /// Sines.
    Sine,
}

impl Form {
    fn choice(self) -> Waveforms {
        match self {
            Self::Bright => Waveform::brightest,
            Self::Sine => Waveform::sine,
        }
    }
}

/// Make the phase function of a pattern for the part of a preliminary recording.
#[derive(Debug, clap::Args)]
pub struct Adapt {
    /// Folder with recording.json and its frames: vertical fringes, and for the paper's method
    /// horizontal ones as well.
    recording: PathBuf,
    /// How it is made.
    #[arg(long, value_enum)]
    method: PatternMethod,
    /// The file for it: f64 turns, projector rows x columns.
    #[arg(long, value_name = "FILE.npy", value_parser = names::file("npy"))]
    out: PathBuf,
    /// σ of the projector's blur, projector pixels; that of a sharp lens if not given.
    #[arg(long, value_name = "PX", default_value_t = 0.5, value_parser = number(0.0, 20.0))]
    projector_blur: f64,
    /// σ of the camera's blur, camera pixels.
    #[arg(long, value_name = "PX", default_value_t = 0.0, value_parser = number(0.0, 20.0))]
    camera_blur: f64,
    /// Smallest pitch in projector pixels; 5 if not given, and 8 always for the paper's method.
    #[arg(long, value_name = "PX", value_parser = number(2.0, 128.0))]
    projector_pitch: Option<f64>,
    /// Smallest pitch in camera pixels; if not given 2.2, and 5 for the paper's method.
    #[arg(long, value_name = "PX", value_parser = number(2.0, 128.0))]
    image_pitch: Option<f64>,
    /// Folder for what to project and to decode it with: pictures, sequence.json, phase function,
    /// expected phase.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    patterns: Option<PathBuf>,
    /// How many pictures to project.
    #[arg(long, value_name = "N", default_value_t = 12, requires = "patterns", value_parser = frames())]
    frames: usize,
    /// What each level shows: the waveform with the most modulation for its number of shifts, or a
    /// sine. The former needs a projector whose light is linear in the grey level within 1 %.
    #[arg(long, value_enum, default_value_t = Form::Bright, requires = "patterns")]
    waveform: Form,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    output: Output,
}

impl Adapt {
    /// Measures the recording, makes the phase function, writes it and prints the report.
    ///
    /// # Errors
    /// If the recording cannot be opened or lacks what the method needs, or the file cannot be
    /// written.
    pub fn run(&self) -> Result<()> {
        let options = self.options()?;
        let Some(name) = self.out.file_name().and_then(|name| name.to_str()) else {
            let message = format!("--out {}: name a file", self.out.display());
            return Exit::Usage.fail(message);
        };
        let recording = Recording::open(&self.recording)?;
        let pool = self.threads.pool(0)?;
        let adapted = pool.install(|| adapt(&recording, &self.recording, &options))?;
        let folder = OutputFolder::create(self.out.parent().unwrap_or(Path::new("")))?;
        let function = &adapted.function;
        let array = npy::write(function.columns(), &function.turns());
        folder.write(name, &array)?;
        let mut frames = None;
        if let Some(patterns) = &self.patterns {
            let width = recording.width as usize;
            let projected = Projected::new(&adapted, width, self.frames, self.waveform.choice())?;
            pool.install(|| projected.write(patterns))?;
            frames = Some(projected.words());
        }
        let text = || {
            let mut lines = vec![adapted.report.table().trim_end().to_owned()];
            lines.extend(frames);
            lines.push(format!("written to {}", self.out.display()));
            lines.join("\n")
        };
        self.output.answer(&adapted.report, text)
    }

    fn options(&self) -> Result<AdaptOptions> {
        let (projector_pitch, image_pitch) = match self.method {
            PatternMethod::Fringed => (noise::PROJECTOR_PITCH, noise::IMAGE_PITCH),
            PatternMethod::Paper => (paper::PROJECTOR_PITCH, paper::IMAGE_PITCH),
        };
        if self.method == PatternMethod::Paper && self.patterns.is_some() {
            return Exit::Usage.fail("--patterns: the sequences are those of --method fringed; the paper's is three geometric levels of four \
                 sines each, which patterns makes of the phase function");
        }
        if self.method == PatternMethod::Paper && self.projector_pitch.is_some() {
            return Exit::Usage.fail(format!(
                    "--projector-pitch: the paper's method has {projector_pitch} px: leave it out, or use \
                     --method fringed"
                ));
        }
        Ok(AdaptOptions {
            method: self.method,
            optics: FringeOptics {
                blur: Blur {
                    projector: self.projector_blur,
                    camera: self.camera_blur,
                },
                projector_pitch: self.projector_pitch.unwrap_or(projector_pitch),
                image_pitch: self.image_pitch.unwrap_or(image_pitch),
            },
        })
    }
}
