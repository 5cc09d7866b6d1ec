//! Makes a recording of other people's pictures (`fringed-lab import`), and says what looks wrong.
//!
//! `folder` and `picture` read the pictures, `samples` brings samples to their bits, `plane` places
//! models without a plate, `geometry` compares models with the fringes, `check`, `code` and `alone`
//! find what looks wrong.

mod alone;
mod check;
mod code;
mod direction;
mod folder;
mod geometry;
mod phases;
mod picture;
mod plane;
mod samples;
mod shifts;

pub use picture::{Channel, Picture};

use super::layout::{Description, Layout};
use appliance::error::{Exit, Failure, Result};
use appliance::head::calibration::opencv::ImportedModels;
use appliance::measure::measure;
use folder::Place;
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::replay::Recording;
use hal::units::Timestamp;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// What the user says about the pictures.
#[derive(Clone, Debug)]
pub struct Taken {
    /// What was projected.
    pub description: Description,
    /// What of colour pictures is taken.
    pub channel: Channel,
    /// Significant bits of a sample; without it those of the files.
    pub bit_depth: Option<u8>,
    /// Beginning of the names of the pictures that are taken, or a pattern of them with * and ?.
    pub name: String,
    /// σ of a sample in counts, if it is known.
    pub noise_counts: Option<f64>,
    /// Lowest and highest z of the working range, mm.
    pub range_mm: Option<[f64; 2]>,
}

/// Reads the pictures of a folder in the order of the numbers in their names. `models` gives the
/// models for frames of this size. The recording's notes say what looks wrong with it, in words
/// with remedies.
///
/// # Errors
/// If the folder is missing (66), the description contradicts itself (64), or a picture is missing
/// or wrong (65).
pub fn import(
    folder: &Path,
    taken: &Taken,
    models: impl FnOnce((u32, u32)) -> Result<Option<ImportedModels>>,
) -> Result<Recording> {
    let layout = Layout::of(&taken.description);
    let layout = layout.map_err(Exit::Usage.because("import"))?;
    let places = folder::pictures(folder, &taken.name, layout.shown.len())?;
    let read = |place: &Place| {
        Picture::read(&place.file, place.page.unwrap_or(0)).map_err(|problem| place.wrong(problem))
    };
    let pictures: Vec<Picture> = places.par_iter().map(read).collect::<Result<_, _>>()?;
    let mut notes = Vec::new();
    let first = &pictures[0];
    let unlike = pictures
        .iter()
        .position(|other| (other.size, other.bits) != (first.size, first.bits));
    if let Some(at) = unlike {
        let describe =
            |of: &Picture| format!("{}×{} pixels of {} bits", of.size.0, of.size.1, of.bits);
        let words = format!(
            "{} where {} has {}: all must come from one camera, choose its pictures with --name",
            describe(&pictures[at]),
            places[0].name(),
            describe(first)
        );
        return Err(places[at].wrong(words));
    }
    if pictures.iter().any(|picture| picture.lossy) {
        notes.push(
            "the pictures are JPEG, which alters samples in blocks of 8×8 pixels, by some counts at fine fringes and edges, and no \
             number of shifts averages that out: save the pictures as PNG or TIFF"
                .into(),
        );
    }
    if taken.channel == Channel::Luminance && pictures.iter().any(Picture::is_colour) {
        notes.push(
            "the pictures are in colour and their luminance is taken: a camera that projects one colour is better read with \
             --channel red, green or blue"
                .into(),
        );
    }
    let ((width, height), file_bits) = (first.size, first.bits);
    let grey = pictures
        .par_iter()
        .map(|picture| picture.grey(taken.channel));
    let mut samples: Vec<Vec<u16>> = grey.collect();
    drop(pictures);
    let bit_depth = samples::right_justify(&mut samples, taken.bit_depth, file_bits);
    let format = FrameFormat::packed(width, height, bit_depth);
    notes.extend(samples::mark_clipped(&mut samples, &layout.shown, format));
    let frame =
        |(at, samples)| frame(format, samples, at).map_err(|problem| places[at].wrong(problem));
    let frames: Vec<Frame> = samples
        .into_par_iter()
        .enumerate()
        .map(frame)
        .collect::<Result<_, _>>()?;
    let models = models((format.width, format.height))?;
    let mut recording = layout.recording(taken.description.projector, format, frames);
    recording.description = format!("imported from {}", name(folder));
    recording.noise_counts = taken.noise_counts;
    recording.range_mm = taken.range_mm;
    if let Some(models) = models {
        notes.extend(geometry::add(&mut recording, models, folder)?);
    }
    notes.extend(
        check::notes(&recording, &taken.description).map_err(|problem| content(folder, problem))?,
    );
    notes.extend(
        alone::notes(&recording, &taken.description).map_err(|problem| content(folder, problem))?,
    );
    notes.extend(direction::notes(&recording));
    if recording.camera_model.is_some() {
        // Levels that cannot be measured were named above.
        let measured = measure(&recording, folder).ok();
        notes.extend(measured.and_then(|measured| measured.report.advice));
    }
    recording.notes = notes;
    Ok(recording)
}

/// A frame of samples that must lie within its bits.
fn frame(format: FrameFormat, samples: Vec<u16>, at: usize) -> Result<Frame, String> {
    let full_scale = format.full_scale();
    let largest = samples.iter().copied().max().unwrap_or(0);
    if largest > full_scale {
        return Err(format!(
            "a sample of {largest}, where {} bits have at most {full_scale}: correct --bit-depth",
            format.bit_depth
        ));
    }
    let pixels = match format.bit_depth {
        8 => Pixels::Eight(samples.into_iter().map(|sample| sample as u8).collect()),
        _ => Pixels::Sixteen(samples),
    };
    Frame::new(format, Arc::new(pixels), Timestamp(0), at as u64).map_err(|error| error.to_string())
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

fn content(path: &Path, problem: impl std::fmt::Display) -> Failure {
    Failure::because(Exit::Content, format!("import {}", path.display()), problem)
}
