//! `fringed-lab patterns DIR`: the pictures to project, and the manifest of the recording that
//! their frames will make.

use crate::description::Description;
use crate::layout::{Layout, Shown};
use crate::lists::{Size, size};
use algo::pattern::{Encoder, PhaseFunction, Shot};
use appliance::cli::numbers::number;
use appliance::cli::{Quiet, Threads, names};
use appliance::error::{Exit, Failure, Result};
use appliance::head::seam;
use appliance::output::grey_png;
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::npy;
use hal::replay::recorder;
use hal::units::Timestamp;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Write the pictures to project: fringes, adaptive fringes, Gray code.
#[derive(Debug, clap::Args)]
pub struct Patterns {
    /// Folder for the pictures and their recording.json; must not exist yet.
    #[arg(value_parser = names::folder())]
    folder: PathBuf,
    #[command(flatten)]
    described: Description,
    /// Phase function of an adaptive pattern, as adapt writes it: then only the ratios of --fringes
    /// count.
    #[arg(long, value_name = "FILE")]
    pattern: Option<PathBuf>,
    /// Columns and rows of the camera's frames.
    #[arg(long, value_name = "WxH", value_parser = size)]
    camera: Size,
    /// Bits of the camera's samples.
    #[arg(long, value_name = "BITS", default_value_t = 8, value_parser = number(8u8, 16))]
    bit_depth: u8,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    quiet: Quiet,
}

/// The largest file of a phase function: f64 on the largest projector.
const MAX_FUNCTION: u64 = 1 << 30;

impl Patterns {
    /// Makes the pictures and writes them.
    ///
    /// # Errors
    /// If the options contradict each other (64), the phase function is missing or wrong (66, 65),
    /// or nothing can be written (73).
    pub fn run(&self) -> Result<()> {
        let usage =
            |error: &dyn std::fmt::Display| Failure::because(Exit::Usage, "patterns", error);
        let projector = self.described.projector();
        let function = self.pattern.as_deref().map(|path| turns(path, projector));
        let description = self.described.complete(function.transpose()?)?;
        let layout = Layout::of(&description).map_err(|error| usage(&error))?;
        let (columns, rows) = (projector.0 as usize, projector.1 as usize);
        let functions: Vec<PhaseFunction> = layout
            .patterns
            .iter()
            .map(|spec| seam::phase_function(spec, columns, rows))
            .collect::<Result<_, _>>()
            .map_err(|error| usage(&error))?;
        let encoder = Encoder::new(None, &[Shot::sine(1.0, 0.0)]);
        let picture = |(at, shown): (usize, &Shown)| {
            let pixels = raster(*shown, &layout, &functions, &encoder, projector);
            (format!("show/{at:03}.png"), grey_png(columns, &pixels))
        };
        let pool = self.threads.pool(0)?;
        let shown = layout.shown.par_iter().enumerate();
        let pictures: Vec<_> = pool.install(|| shown.map(picture).collect());
        let Size(width, height) = self.camera;
        let format = FrameFormat::packed(width, height, self.bit_depth);
        // Frames that are yet to be taken: only their places are written, by their counts.
        let pixel = FrameFormat::packed(1, 1, 8);
        let pixels = Arc::new(Pixels::zeroed(&pixel));
        let frame = Frame::new(pixel, pixels, Timestamp(0), 0)
            .map_err(Exit::Software.because("patterns"))?;
        let frames = (0..).map(|at| frame.restamped(Timestamp(0), at));
        let mut outline = layout.recording(projector, format, frames);
        outline.description = "to be filled with the frames of show/".into();
        recorder::write_outline(&outline, &self.folder, &pictures).map_err(|error| {
            let exit = match error {
                recorder::RecorderError::Content { .. } => Exit::Usage,
                _ => Exit::CannotCreate,
            };
            Failure::new(exit, error)
        })?;
        let count = layout.shown.len();
        self.quiet.say(|| {
            format!(
                "wrote {count} pictures to {}: project them in their order and save the frame of each under its name in frames/",
                self.folder.join("show").display()
            )
        });
        Ok(())
    }
}

/// The phase function in a file, for a projector of this size.
fn turns(path: &Path, (columns, rows): (u32, u32)) -> Result<Vec<f64>> {
    let name = path.display();
    let wrong = |error: &dyn std::fmt::Display| {
        Failure::because(Exit::Content, format!("read {name}"), error)
    };
    let remedy = "name a phase function that adapt wrote";
    let missing = Exit::Missing.advising(format!("read {name}"), remedy);
    let length = std::fs::metadata(path).map_err(&missing)?.len();
    if length > MAX_FUNCTION {
        return Err(wrong(
            &"it is larger than a phase function of any projector",
        ));
    }
    let bytes = std::fs::read(path).map_err(&missing)?;
    let array = npy::read::<f64>(&bytes).map_err(|error| wrong(&error))?;
    match (array.columns, array.rows) == (columns as usize, rows as usize) {
        true => Ok(array.elements),
        false => Err(wrong(&format!(
            "it has {} columns and {} rows, --projector {columns} and {rows}: give the size of the projector that it was made for",
            array.columns, array.rows
        ))),
    }
}

/// The grey levels of one picture, row-major.
fn raster(
    shown: Shown,
    layout: &Layout,
    functions: &[PhaseFunction],
    encoder: &Encoder,
    (columns, rows): (u32, u32),
) -> Vec<u8> {
    let all = columns as usize * rows as usize;
    match shown {
        Shown::Sine {
            pattern,
            ratio,
            shift,
        } => {
            encoder
                .raster(&functions[pattern], Shot::sine(ratio, shift))
                .pixels
        }
        Shown::Bit {
            pattern,
            bit,
            inverse,
        } => {
            let (code, vertical) = (&layout.codes[pattern], layout.is_vertical(pattern));
            let places = (0..rows).flat_map(|row| {
                (0..columns).map(move |column| if vertical { column } else { row })
            });
            let lit = places.map(|place| code.lights(bit, place) != inverse);
            lit.map(|lit| if lit { u8::MAX } else { 0 }).collect()
        }
        Shown::White => vec![u8::MAX; all],
        Shown::Black => vec![0; all],
    }
}
