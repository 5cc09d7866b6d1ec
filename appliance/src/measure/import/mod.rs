//! Makes a recording of other people's pictures (`fringed import`), and says what looks wrong.

mod check;
mod code;
mod picture;
mod samples;
mod shifts;

pub use picture::{Channel, Picture};

use super::layout::{Description, Layout};
use crate::error::{Exit, Failure};
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::model::DeviceModel;
use hal::replay::Recording;
use hal::units::Timestamp;
use picture::ENDINGS;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::fs;
use std::path::{Path, PathBuf};
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
    /// Beginning of the names of the pictures that are taken.
    pub name: String,
}

/// Reads the pictures of a folder in the order of the numbers in their names. `models` gives the models for frames of this size. The
/// recording's notes say what looks wrong with it, in words with remedies.
///
/// # Errors
/// If the folder is missing (66), the description contradicts itself (64), or a picture is missing or wrong (65).
pub fn import(
    folder: &Path,
    taken: &Taken,
    models: impl FnOnce((u32, u32)) -> Result<Option<(DeviceModel, DeviceModel)>, Failure>,
) -> Result<Recording, Failure> {
    let layout = Layout::of(&taken.description);
    let layout = layout.map_err(|problem| Failure::because(Exit::Usage, "import", problem))?;
    let files = pictures(folder, &taken.name)?;
    let (expected, found) = (layout.shown.len(), files.len());
    if expected != found {
        let ends = match &files[..] {
            [first, .., last] => format!(" ({} to {})", name(first), name(last)),
            _ => String::new(),
        };
        let words = format!(
            "{found} pictures{ends}, but the options describe {expected}: correct the options, or choose pictures with --name"
        );
        return Err(content(folder, words));
    }
    let read = |file: &PathBuf| Picture::read(file).map_err(|problem| content(file, problem));
    let pictures: Vec<Picture> = files.par_iter().map(read).collect::<Result<_, _>>()?;
    let mut notes = Vec::new();
    let first = &pictures[0];
    let unlike = pictures
        .iter()
        .position(|other| (other.size, other.bits) != (first.size, first.bits));
    if let Some(at) = unlike {
        let describe =
            |of: &Picture| format!("{}×{} pixels of {} bits", of.size.0, of.size.1, of.bits);
        let words = format!(
            "{} where {} has {}: all must come from one camera",
            describe(&pictures[at]),
            name(&files[0]),
            describe(first)
        );
        return Err(content(&files[at], words));
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
        |(at, samples)| frame(format, samples, at).map_err(|problem| content(&files[at], problem));
    let frames: Vec<Frame> = samples
        .into_par_iter()
        .enumerate()
        .map(frame)
        .collect::<Result<_, _>>()?;
    let models = models((format.width, format.height))?;
    let (camera_model, projector_model) = models.unzip();
    let mut recording = layout.recording(taken.description.projector, format, frames);
    recording.description = format!("imported from {}", name(folder));
    recording.camera_model = camera_model;
    recording.projector.model = projector_model;
    notes.extend(
        check::notes(&recording, &taken.description).map_err(|problem| content(folder, problem))?,
    );
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

/// The pictures of a folder whose names begin with `beginning`, in the order of the numbers in their names.
fn pictures(folder: &Path, beginning: &str) -> Result<Vec<PathBuf>, Failure> {
    let entries = fs::read_dir(folder).map_err(|error| {
        let what = format!("import {}", folder.display());
        Failure::because(
            Exit::Missing,
            what,
            format!("{error}: name a folder of pictures"),
        )
    })?;
    let is_picture = |path: &PathBuf| {
        let ending = path.extension().and_then(|ending| ending.to_str());
        ending.is_some_and(|ending| {
            ENDINGS
                .iter()
                .any(|known| known.eq_ignore_ascii_case(ending))
        }) && name(path).starts_with(beginning)
            && path.is_file()
    };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut found: Vec<PathBuf> = paths.filter(is_picture).collect();
    found.sort_by(|a, b| by_numbers(&name(a), &name(b)));
    match found.is_empty() {
        false => Ok(found),
        true => Err(content(
            folder,
            format!("no picture whose name begins with {beginning:?}: PNG, BMP and TIFF are read"),
        )),
    }
}

/// Compares names so that pat2 comes before pat10.
fn by_numbers(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let (text_a, text_b) = (until_digit(a), until_digit(b));
        let order = text_a.cmp(text_b);
        (a, b) = (&a[text_a.len()..], &b[text_b.len()..]);
        if order != Ordering::Equal || a.is_empty() || b.is_empty() {
            return order.then(a.len().cmp(&b.len()));
        }
        let (number_a, number_b) = (digits(a), digits(b));
        let plain = |number: &str| number.trim_start_matches('0').to_owned();
        let (plain_a, plain_b) = (plain(number_a), plain(number_b));
        let order = plain_a
            .len()
            .cmp(&plain_b.len())
            .then(plain_a.cmp(&plain_b));
        (a, b) = (&a[number_a.len()..], &b[number_b.len()..]);
        if order != Ordering::Equal {
            return order;
        }
    }
}

fn until_digit(text: &str) -> &str {
    let end = text.find(|letter: char| letter.is_ascii_digit());
    &text[..end.unwrap_or(text.len())]
}

fn digits(text: &str) -> &str {
    let end = text.find(|letter: char| !letter.is_ascii_digit());
    &text[..end.unwrap_or(text.len())]
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

fn content(path: &Path, problem: impl std::fmt::Display) -> Failure {
    Failure::because(Exit::Content, format!("import {}", path.display()), problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_taken_in_the_order_of_the_numbers_in_their_names() {
        let mut names = [
            "p10.png",
            "p2.png",
            "p1.png",
            "a3_20.png",
            "a3_3.png",
            "p02b.png",
        ];
        names.sort_by(|a, b| by_numbers(a, b));
        assert_eq!(
            names,
            [
                "a3_3.png",
                "a3_20.png",
                "p1.png",
                "p2.png",
                "p02b.png",
                "p10.png"
            ]
        );
    }
}
