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
        let size = frames
            .first()
            .map_or((0, 0), |frame| (frame.width(), frame.height()));
        let count = frames.len();
        let length = count * size.0 * size.1;
        let eight = matches!(
            frames.first().map(|frame| frame.row(0)),
            Some(Samples::Eight(_))
        );
        let row = |v: usize| move |frame: usize, u: usize| frames[frame].row(v).at(u);
        let samples = match eight {
            true => {
                let mut all = vec![0_u8; length];
                for_each_row(&mut all, count * size.0, |v, out| {
                    correct(levels, (row(v), count, full_scale), out, |sample| {
                        sample as u8
                    });
                });
                Buffer::Eight(all)
            }
            false => {
                let mut all = vec![0_u16; length];
                for_each_row(&mut all, count * size.0, |v, out| {
                    correct(levels, (row(v), count, full_scale), out, |sample| sample);
                });
                Buffer::Sixteen(all)
            }
        };
        Self {
            samples,
            size,
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

/// Writes a row of all `count` frames, one after the other; `sample(frame, column)` is what was
/// taken.
fn correct<T>(
    levels: &[(&LevelShifts, Vec<FrameLight>)],
    (sample, count, full_scale): (impl Fn(usize, usize) -> u16, usize, u16),
    out: &mut [T],
    to: impl Fn(u16) -> T,
) {
    let width = out.len() / count.max(1);
    for frame in 0..count {
        for u in 0..width {
            out[frame * width + u] = to(sample(frame, u));
        }
    }
    let most = f64::from(full_scale) - 1.0;
    for (level, light) in levels {
        let places = (0..width).flat_map(|u| level.frames.iter().map(move |&frame| (frame, u)));
        let mut row = LevelRow {
            level,
            light,
            samples: places
                .map(|(frame, u)| f64::from(sample(frame, u)))
                .collect(),
            contrasts: Vec::new(),
        };
        NEIGHBOURS.iter().for_each(|&reach| row.look(reach));
        let mut pixel = vec![0.0; level.frames.len()];
        for u in 0..width {
            row.steady(u, &mut pixel);
            for (corrected, &frame) in pixel.iter().zip(&level.frames) {
                if sample(frame, u) < full_scale {
                    out[frame * width + u] = to(libm::rint(corrected.clamp(0.0, most)) as u16);
                }
            }
        }
    }
}
