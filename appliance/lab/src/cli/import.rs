//! `fringed-lab import DIR --out RECORDING`: a recording of other people's pictures.

use crate::description::Description;
use crate::import::{Channel, Taken, import};
use crate::lists::range;
use appliance::cli::numbers::number;
use appliance::cli::{Output, Threads, model_files, names};
use appliance::error::{Exit, Result};
use appliance::head::calibration::opencv::{self, Declared, ImportedModels, Sizes, Unit};
use hal::bounds::{MAX_NOISE_COUNTS, MAX_RANGE_MM, MIN_NOISE_COUNTS};
use hal::replay::recorder;
use serde::Serialize;
use std::path::PathBuf;

/// Make a recording of pictures that other programs took.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("imported").args(["camera_model", "projector_model", "models"]).multiple(true))]
pub struct Import {
    /// Folder of PNG, BMP, TIFF or JPEG pictures, named in the order of projection; each page of a
    /// TIFF is a picture.
    folder: PathBuf,
    /// Folder for the recording; must not exist yet.
    #[arg(long, value_name = "DIR", value_parser = names::folder())]
    out: PathBuf,
    #[command(flatten)]
    described: Description,
    /// Take only pictures whose names begin with this, or fit a pattern of * and ?, such as *-left.
    #[arg(
        long,
        value_name = "TEXT",
        default_value = "",
        hide_default_value = true
    )]
    name: String,
    /// What of colour pictures is taken.
    #[arg(long, default_value = "luminance")]
    channel: Channel,
    /// Significant bits of a sample, 9 to 16, where 16-bit pictures hold fewer.
    #[arg(long, value_name = "BITS", value_parser = number(9u8, 16))]
    bit_depth: Option<u8>,
    /// σ of one sample in counts; without it fringes need 16 of 255 counts of modulation.
    #[arg(long, value_name = "COUNTS", value_parser = number(MIN_NOISE_COUNTS, MAX_NOISE_COUNTS))]
    noise: Option<f64>,
    /// Working range of z about the plane z = 0, mm; without it a fifth of the camera's distance to
    /// both sides.
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true, value_parser = range(MAX_RANGE_MM))]
    range: Option<[f64; 2]>,
    /// The camera's model, written by OpenCV (YAML, XML, JSON). Without models there are phases but
    /// no heights.
    #[arg(long, value_name = "FILE", requires = "projector_model")]
    camera_model: Option<PathBuf>,
    /// The projector's model.
    #[arg(long, value_name = "FILE", requires = "camera_model")]
    projector_model: Option<PathBuf>,
    /// Both models in one file, as for calibrate; without the pose of a plate, see --plane-at.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["camera_model", "projector_model"])]
    models: Option<PathBuf>,
    /// Unit of lengths in the models' files, where they do not say it.
    #[arg(long, requires = "imported")]
    unit: Option<Unit>,
    /// The world's z in the models' files points away from the head, as on OpenCV's boards.
    #[arg(long, requires = "imported")]
    z_away: bool,
    /// The plane z = 0 stands across the camera's axis at this distance: for models without the
    /// pose of a plate. Without it z = 0 is the plane that fits the measured points best.
    #[arg(long, value_name = "MM", requires = "imported", value_parser = number(1.0, MAX_RANGE_MM))]
    plane_at: Option<f64>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    output: Output,
}

/// What was imported.
#[derive(Serialize)]
struct Summary {
    /// The folder of the recording.
    recording: PathBuf,
    /// Width, height and bits of the frames.
    camera: (u32, u32, u8),
    /// Pictures of levels, codes, white and black.
    frames: usize,
    code_pictures: usize,
    uniform: usize,
    models: bool,
    /// What looks wrong.
    notes: Vec<String>,
}

impl Import {
    /// Reads the pictures, writes the recording, and prints what looks wrong.
    ///
    /// # Errors
    /// If the folder or a model is missing (66), the options contradict each other or the pictures
    /// (64, 65), or the recording cannot be written (73).
    pub fn run(&self) -> Result<()> {
        let taken = Taken {
            description: self.described.complete(None)?,
            channel: self.channel,
            bit_depth: self.bit_depth,
            name: self.name.clone(),
            noise_counts: self.noise,
            range_mm: self.range,
        };
        let pool = self.threads.pool(0)?;
        let models = |frames| self.models(frames);
        // The models are read on this thread: only pictures are worth others.
        let recording = pool.install(|| import(&self.folder, &taken, models))?;
        recorder::write(&recording, &self.out).map_err(Exit::CannotCreate.failure())?;
        let codes = recording.codes.iter();
        let summary = Summary {
            recording: self.out.clone(),
            camera: (recording.width, recording.height, recording.bit_depth),
            frames: recording.frames.len(),
            code_pictures: codes.map(|code| code.bits.len() + code.inverse.len()).sum(),
            uniform: recording.white.iter().chain(&recording.black).count(),
            models: recording.camera_model.is_some(),
            notes: recording.notes.clone(),
        };
        self.output.answer(&summary, || {
            let (width, height, bits) = summary.camera;
            let pictures = summary.frames + summary.code_pictures + summary.uniform;
            let mut lines: Vec<String> = summary
                .notes
                .iter()
                .map(|note| format!("looks wrong: {note}"))
                .collect();
            lines.push(format!(
                "imported {pictures} pictures of {width}×{height} pixels, {bits} bits, to {}",
                self.out.display()
            ));
            lines.join("\n")
        })
    }

    /// The models that the options name, for frames of this size.
    fn models(&self, camera: (u32, u32)) -> Result<Option<ImportedModels>> {
        let named = [&self.camera_model, &self.projector_model, &self.models];
        model_files(named.into_iter().flatten())?;
        let sizes = Sizes {
            camera,
            projector: self.described.projector(),
        };
        let declared = Declared {
            unit: self.unit,
            z_away: self.z_away,
            plane_at: self.plane_at,
        };
        let both = match (&self.camera_model, &self.projector_model, &self.models) {
            (Some(camera), Some(projector), _) => {
                opencv::from_two(camera, projector, sizes, declared)
            }
            (_, _, Some(models)) => opencv::from_one(models, sizes, declared),
            _ => return Ok(None),
        };
        both.map(Some)
    }
}
