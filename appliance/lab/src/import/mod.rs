//! Makes a recording of other people's pictures (`fringed-lab import`), and says what looks wrong.
//!
//! `folder` and `picture` read the pictures, and here their samples are brought to their bits;
//! `plane` places models without a plate, `geometry` compares models with the fringes, `check`,
//! `code` and `direction` find what looks wrong.

mod check;
mod code;
mod direction;
mod folder;
mod geometry;
mod picture;
mod plane;

pub use picture::{Channel, Picture, PictureError};

use crate::Failed;
use crate::description::Description;
use crate::layout::{Layout, Shown};
use appliance::error::{Exit, Failure, Result};
use appliance::head::calibration::opencv::ImportedModels;
use appliance::measure::measure;
use folder::Place;
use hal::bounds::shortened;
use hal::frame::{Frame, FrameFormat, Pixels};
use hal::replay::Recording;
use hal::units::Timestamp;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// How many times as often as any other bright sample the largest one must occur: the crest of a
/// sine alone makes it 2.4 times as often at most, where noise does not smooth it.
const PLATEAU: usize = 4;
/// Samples are bright if they are within the largest sample divided by this of it.
const AS_BRIGHT: u16 = 32;
/// Fewest samples as bright that tell whether the largest is one of many values or one of few, in
/// all and as a share of its own.
const FEWEST: usize = 8;
const SPARSE: usize = 512;

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
        let read = Picture::read(&place.file, place.page.unwrap_or(0));
        read.map_err(|problem| place.wrong(shortened(&problem.to_string())))
    };
    let pictures: Vec<Picture> = places.par_iter().map(read).collect::<Result<_, _>>()?;
    let mut notes = Vec::new();
    let first = &pictures[0];
    let unlike = pictures
        .iter()
        .position(|other| (other.size, other.bits) != (first.size, first.bits));
    if let Some(at) = unlike {
        let describe = |picture: &Picture| {
            let (width, height) = picture.size;
            format!("{width}×{height} pixels of {} bits", picture.bits)
        };
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
    let bit_depth = right_justify(&mut samples, taken.bit_depth, file_bits);
    let format = FrameFormat::packed(width, height, bit_depth);
    notes.extend(mark_clipped(&mut samples, &layout.shown, format));
    let frame =
        |(at, samples)| frame(format, samples, at).map_err(|problem| places[at].wrong(problem));
    let frames: Vec<Frame> = samples
        .into_par_iter()
        .enumerate()
        .map(frame)
        .collect::<Result<_, _>>()?;
    let models = models((format.width, format.height))?;
    let mut recording = layout.recording(taken.description.projector(), format, frames);
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
        code::notes_alone(&recording, &taken.description)
            .map_err(|problem| content(folder, problem))?,
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

/// Brings samples of 16 bits that stand in the upper bits, as some cameras write 10 and 12 bits, to
/// the lower ones, and returns how many bits they have: those that are stated, else those of the
/// files.
fn right_justify(pictures: &mut [Vec<u16>], stated: Option<u8>, file: u8) -> u8 {
    let used = pictures
        .iter()
        .flatten()
        .fold(0, |all, sample| all | sample);
    let unused = if used == 0 { 0 } else { used.trailing_zeros() };
    let bits = stated.unwrap_or(match file {
        16 => (16 - unused).max(8) as u8,
        _ => file,
    });
    let shift = 16 - u32::from(bits);
    let left = shift <= unused && (stated.is_none() || u32::from(used) >> bits != 0);
    if file == 16 && shift > 0 && left {
        for sample in pictures.iter_mut().flatten() {
            *sample >>= shift;
        }
    }
    bits
}

/// Finds samples of fringes that are clipped below full scale, as where the range of a picture is
/// limited to 235, and sets them to full scale, so that their pixels count as saturated. Returns
/// the remedy in words if there are any.
fn mark_clipped(pictures: &mut [Vec<u16>], shown: &[Shown], format: FrameFormat) -> Option<String> {
    let levels = levels(shown);
    let sines = || levels.iter().flatten();
    let full_scale = format.full_scale();
    let largest = sines().flat_map(|&at| &pictures[at]).copied().max()?;
    let darker = largest - largest / AS_BRIGHT;
    if largest >= full_scale || darker == largest {
        return None;
    }
    // What does not change from shift to shift is no fringe: a frame around it, a date.
    let clipped = |level: &[usize], pixel: usize| {
        let samples = || level.iter().map(|&at| pictures[at][pixel]);
        samples().any(|sample| sample == largest) && samples().any(|sample| sample < darker)
    };
    let mut counts = vec![0_usize; usize::from(largest - darker) + 1];
    let mut reached = vec![false; pictures[0].len()];
    for level in &levels {
        for (pixel, reached) in reached.iter_mut().enumerate() {
            *reached |= clipped(level, pixel);
        }
        for &at in level {
            for sample in pictures[at].iter().filter(|sample| **sample >= darker) {
                counts[usize::from(sample - darker)] += 1;
            }
        }
    }
    let most = counts.pop()?;
    let bright: usize = counts.iter().sum();
    let fullest = counts.into_iter().max().unwrap_or(0);
    let pixels = reached.iter().filter(|reached| **reached).count();
    if pixels == 0 || bright < FEWEST.max(most / SPARSE) || most <= PLATEAU * fullest {
        return None;
    }
    for &at in levels.iter().flatten() {
        for (sample, _) in pictures[at]
            .iter_mut()
            .zip(&reached)
            .filter(|(sample, reached)| **sample == largest && **reached)
        {
            *sample = full_scale;
        }
    }
    Some(format!(
        "fringes are clipped at {largest} of {full_scale} counts in {:.1} % of the pixels, of which these samples are left out: \
         expose for a shorter time",
        100.0 * pixels as f64 / reached.len().max(1) as f64
    ))
}

/// The places of the frames of each level.
fn levels(shown: &[Shown]) -> Vec<Vec<usize>> {
    let mut levels: Vec<((usize, f64), Vec<usize>)> = Vec::new();
    for (at, shown) in shown.iter().enumerate() {
        if let Shown::Sine { pattern, ratio, .. } = *shown {
            match levels
                .iter_mut()
                .find(|(level, _)| *level == (pattern, ratio))
            {
                Some((_, frames)) => frames.push(at),
                None => levels.push(((pattern, ratio), vec![at])),
            }
        }
    }
    levels.into_iter().map(|(_, frames)| frames).collect()
}

/// A frame of samples that must lie within its bits.
fn frame(format: FrameFormat, samples: Vec<u16>, count: usize) -> Result<Frame, Failed> {
    let full_scale = format.full_scale();
    let largest = samples.iter().copied().max().unwrap_or(0);
    if largest > full_scale {
        let bits = format.bit_depth;
        return Err(format!("a sample of {largest}, where {bits} bits have at most {full_scale}: correct --bit-depth").into());
    }
    let pixels = match format.bit_depth {
        8 => Pixels::Eight(samples.into_iter().map(|sample| sample as u8).collect()),
        _ => Pixels::Sixteen(samples),
    };
    Ok(Frame::new(
        format,
        Arc::new(pixels),
        Timestamp(0),
        count as u64,
    )?)
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
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
    use std::f64::consts::TAU;

    const PIXELS: usize = 4000;
    const SHIFTS: usize = 4;

    /// A level of 12 bits whose samples are above `clip` nowhere, with noise of ± 2 counts.
    fn level(clip: u16, noise: f64) -> (Vec<Vec<u16>>, Vec<Shown>) {
        let mut random = SplitMix64::seed_from_u64(3);
        let mut picture = |k: usize| {
            let sample = |pixel: usize| {
                let turns = pixel as f64 / 83.7 + k as f64 / SHIFTS as f64;
                let unit = f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5;
                let light = 1900.0 + 1500.0 * (TAU * turns).sin() + 2.0 * noise * unit;
                (light.round() as u16).min(clip)
            };
            (0..PIXELS).map(sample).collect()
        };
        let pictures = (0..SHIFTS).map(&mut picture).collect();
        let shown = |k: usize| Shown::Sine {
            pattern: 0,
            ratio: 1.0,
            shift: k as f64 / SHIFTS as f64,
        };
        (pictures, (0..SHIFTS).map(shown).collect())
    }

    #[test]
    fn samples_in_the_upper_bits_are_brought_to_the_lower_ones_and_no_others() {
        for (file, stated, bits, shift) in [
            (16, None, 12, 4),
            (16, Some(12), 12, 4),
            (16, Some(14), 14, 2),
            (16, Some(16), 16, 0),
        ] {
            let mut pictures = vec![vec![0, 16 * 17, 65520], vec![16, 32, 64]];
            let before = pictures.clone();
            assert_eq!(right_justify(&mut pictures, stated, file), bits);
            assert_eq!(pictures[0][2], before[0][2] >> shift);
            assert_eq!(pictures[1][1], before[1][1] >> shift);
        }
        let mut right = vec![vec![16, 4080]];
        assert_eq!(right_justify(&mut right, Some(12), 16), 12);
        assert_eq!(right, [[16, 4080]]);
        let mut bytes = vec![vec![16, 64]];
        assert_eq!(right_justify(&mut bytes, None, 8), 8);
        assert_eq!(bytes, [[16, 64]]);
    }

    #[test]
    fn a_plateau_below_full_scale_is_clipping_and_the_crest_of_a_sine_is_not() {
        let format = FrameFormat::packed(PIXELS as u32, 1, 12);
        for noise in [0.0, 2.0] {
            let (mut pictures, shown) = level(4095, noise);
            assert_eq!(mark_clipped(&mut pictures, &shown, format), None);
            assert_eq!(pictures, level(4095, noise).0);
            let (mut pictures, shown) = level(3000, noise);
            let words = mark_clipped(&mut pictures, &shown, format).unwrap();
            assert!(words.contains("at 3000 of 4095 counts"), "{words}");
            let all = || pictures.iter().flatten();
            assert!(all().all(|sample| *sample < 3000 || *sample == 4095));
        }
    }
}
