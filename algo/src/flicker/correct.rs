//! Frames without the changes of their light.

use super::level::{FrameLight, LevelShifts, RUN, steady};
use crate::frame::{FrameView, Samples};
use crate::pipeline::for_each_row;
use alloc::vec;
use alloc::vec::Vec;

/// A pixel's contrast is that of its neighbours so far away, pixels: first over a few fringes, as
/// changes of light make it ripple along them, then of as few pixels as noise allows, as it steps
/// where the part has an edge.
const NEIGHBOURS: [usize; 2] = [RUN / 2, 3];

/// Frames in steady light, each row of all of them after the other.
#[derive(Debug)]
pub struct SteadyFrames {
    samples: Buffer,
    size: (usize, usize),
    count: usize,
}

/// Samples as the decoder wants them.
#[derive(Debug)]
enum Buffer {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

impl SteadyFrames {
    /// The frames in the light that each level has in the mean. A sample at full scale stays there, so
    /// that it is still known as overexposed, and no other gets there.
    pub(super) fn of(
        levels: &[(&LevelShifts, Vec<FrameLight>)],
        frames: &[FrameView<'_>],
        full_scale: u16,
    ) -> Self {
        let count = frames.len();
        let width = frames.first().map_or(0, FrameView::width);
        let mut samples = vec![0; frames.iter().map(|frame| width * frame.height()).sum()];
        for_each_row(&mut samples, count * width, |v, out| {
            for (row, frame) in out.chunks_mut(width).zip(frames) {
                for (u, sample) in row.iter_mut().enumerate() {
                    *sample = frame.row(v).at(u);
                }
            }
            for (level, light) in levels {
                correct(level, light, (out, width), full_scale);
            }
        });
        let eight = |frame: &FrameView<'_>| matches!(frame.row(0), Samples::Eight(_));
        Self {
            samples: match frames.first().is_some_and(eight) {
                true => Buffer::Eight(samples.iter().map(|&sample| sample as u8).collect()),
                false => Buffer::Sixteen(samples),
            },
            size: (width, frames.first().map_or(0, FrameView::height)),
            count,
        }
    }

    /// The frames, in the order of the sequence.
    pub fn views(&self) -> impl Iterator<Item = FrameView<'_>> {
        let (width, height) = self.size;
        (0..self.count).filter_map(move |frame| {
            let begin = frame * width;
            let samples = match &self.samples {
                Buffer::Eight(all) => Samples::Eight(&all[begin..]),
                Buffer::Sixteen(all) => Samples::Sixteen(&all[begin..]),
            };
            // The samples were made for this size.
            FrameView::new(samples, width, height, self.count * width).ok()
        })
    }
}

/// A row of the frames of a level.
struct LevelRow<'a> {
    level: &'a LevelShifts,
    light: &'a [FrameLight],
    /// Samples of a pixel behind each other.
    samples: Vec<f64>,
    /// B/A of each pixel and its neighbours.
    contrasts: Vec<f64>,
}

impl LevelRow<'_> {
    /// The samples of a pixel in one light.
    fn steady(&self, u: usize, pixel: &mut [f64]) {
        let count = pixel.len();
        pixel.copy_from_slice(&self.samples[u * count..][..count]);
        steady(self.level, pixel, self.light, self.contrasts[u]);
    }

    /// Finds the contrasts from neighbours up to `reach` pixels away, corrected by the contrasts so far,
    /// if any.
    fn look(&mut self, reach: usize) {
        let count = self.level.frames.len();
        let width = self.samples.len() / count;
        let mut pixel = vec![0.0; count];
        let mut sums = vec![[0.0; 2]; width + 1];
        for u in 0..width {
            match self.contrasts.is_empty() {
                true => pixel.copy_from_slice(&self.samples[u * count..][..count]),
                false => self.steady(u, &mut pixel),
            }
            let [offset, re, im] = self.level.demodulate(pixel.iter().copied());
            let modulation = libm::sqrt(re * re + im * im);
            sums[u + 1] = [sums[u][0] + offset, sums[u][1] + modulation];
        }
        let contrast = |u: usize| {
            let (from, to) = (u.saturating_sub(reach), (u + reach + 1).min(width));
            let [offset, modulation] = [0, 1].map(|part| sums[to][part] - sums[from][part]);
            modulation / offset.max(1.0)
        };
        self.contrasts = (0..width).map(contrast).collect();
    }
}

/// Corrects the samples of a level in a row of all frames, one frame after the other.
fn correct(
    level: &LevelShifts,
    light: &[FrameLight],
    (row, width): (&mut [u16], usize),
    full_scale: u16,
) {
    let places = (0..width).flat_map(|u| level.frames.iter().map(move |frame| frame * width + u));
    let mut seen = LevelRow {
        level,
        light,
        samples: places.map(|at| f64::from(row[at])).collect(),
        contrasts: Vec::new(),
    };
    NEIGHBOURS.iter().for_each(|&reach| seen.look(reach));
    let mut pixel = vec![0.0; level.frames.len()];
    for u in 0..width {
        seen.steady(u, &mut pixel);
        for (corrected, frame) in pixel.iter().zip(&level.frames) {
            let sample = &mut row[frame * width + u];
            if *sample < full_scale {
                *sample = libm::rint(corrected.clamp(0.0, f64::from(full_scale) - 1.0)) as u16;
            }
        }
    }
}
