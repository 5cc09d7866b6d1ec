//! Camera frames as borrowed samples, their mean, and a camera's noise.
//!
//! `FrameView::row` is where a frame's stride is dropped: everything that decodes gets slices of
//! whole rows without padding. What reads samples without it (the doctor, means of frames, the live
//! picture, the recorder) leaves the padding out by itself.

mod noise;

pub use noise::{CameraNoise, NoisePoint, PhotonTransfer, SampleNoise};

use alloc::vec;
use alloc::vec::Vec;

/// A sample that a camera delivers: `u8` for 8 bits, `u16` for 9 to 16.
pub trait Sample: Copy + Send + Sync {
    /// The sample in counts.
    fn count(self) -> i32;
}

impl Sample for u8 {
    #[inline(always)]
    fn count(self) -> i32 {
        i32::from(self)
    }
}

impl Sample for u16 {
    #[inline(always)]
    fn count(self) -> i32 {
        i32::from(self)
    }
}

/// The samples of a frame, row by row with a stride.
#[derive(Clone, Copy, Debug)]
pub enum Samples<'a> {
    /// 8 bits per sample.
    Eight(&'a [u8]),
    /// 9 to 16 bits per sample, in the low bits of each `u16`.
    Sixteen(&'a [u16]),
}

impl Samples<'_> {
    fn len(&self) -> usize {
        match self {
            Samples::Eight(samples) => samples.len(),
            Samples::Sixteen(samples) => samples.len(),
        }
    }

    /// A sample in counts.
    #[inline]
    pub fn at(&self, u: usize) -> u16 {
        match self {
            Samples::Eight(samples) => samples[u].into(),
            Samples::Sixteen(samples) => samples[u],
        }
    }

    /// Adds the samples to sums of as many pixels.
    pub fn add_to(&self, sums: &mut [u32]) {
        match self {
            Samples::Eight(samples) => add(sums, samples),
            Samples::Sixteen(samples) => add(sums, samples),
        }
    }
}

/// A frame of `width` × `height` samples, borrowed from its owner.
#[derive(Clone, Copy, Debug)]
pub struct FrameView<'a> {
    samples: Samples<'a>,
    width: usize,
    height: usize,
    stride: usize,
}

/// Samples that are too few for the frame's size and stride.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a frame of {given} samples was given where size and stride need {needed}")]
pub struct FrameError {
    /// Samples needed for the size and stride.
    pub needed: usize,
    /// Samples given.
    pub given: usize,
}

impl<'a> FrameView<'a> {
    /// A view of `height` rows of `width` samples that start `stride` samples apart.
    ///
    /// # Errors
    /// If the stride is shorter than a row or the samples end before the last row does.
    pub fn new(
        samples: Samples<'a>,
        width: usize,
        height: usize,
        stride: usize,
    ) -> Result<Self, FrameError> {
        let needed = match height.checked_sub(1) {
            None => 0,
            Some(rows) => rows
                .checked_mul(stride)
                .and_then(|before| before.checked_add(width))
                .unwrap_or(usize::MAX),
        };
        if stride < width || samples.len() < needed {
            return Err(FrameError {
                needed: needed.max(width),
                given: samples.len(),
            });
        }
        Ok(Self {
            samples,
            width,
            height,
            stride,
        })
    }

    /// Samples per row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The samples of row `v`, `width` of them.
    #[inline]
    pub fn row(&self, v: usize) -> Samples<'a> {
        let row = v * self.stride..v * self.stride + self.width;
        match self.samples {
            Samples::Eight(samples) => Samples::Eight(&samples[row]),
            Samples::Sixteen(samples) => Samples::Sixteen(&samples[row]),
        }
    }
}

/// The mean of frames of equal size, scaled from `full_scale` counts to 0…255. Over the shifts of a
/// level it is the offset A: what the scene looks like under even light. Of a waveform's harmonics
/// those of an order that is a multiple of the number of shifts stay in it: at most 0.17 B, and
/// what optics leave of that, for N = 3; none for even N. So edges are not sought in it.
pub fn mean(frames: &[FrameView<'_>], full_scale: u16) -> Vec<u8> {
    let Some(first) = frames.first() else {
        return Vec::new();
    };
    let (width, height) = (first.width(), first.height());
    // At most 64 frames of 16 bits at 255: 30 bits.
    let divisor = (frames.len() as u32 * u32::from(full_scale)).max(1);
    let mut picture = vec![0; width * height];
    let mut sums = vec![0_u32; width];
    for (v, row) in picture.chunks_mut(width.max(1)).enumerate() {
        sums.fill(0);
        for frame in frames {
            frame.row(v).add_to(&mut sums);
        }
        for (pixel, sum) in row.iter_mut().zip(&sums) {
            *pixel = ((sum * 255 + divisor / 2) / divisor).min(255) as u8;
        }
    }
    picture
}

fn add<T: Copy + Into<u32>>(sums: &mut [u32], row: &[T]) {
    for (sum, &sample) in sums.iter_mut().zip(row) {
        *sum += sample.into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_follow_the_stride_and_short_frames_are_refused() {
        let samples = [1_u8, 2, 99, 3, 4];
        let view = FrameView::new(Samples::Eight(&samples), 2, 2, 3).unwrap();
        assert!(matches!(view.row(1), Samples::Eight(&[3, 4])));
        let error = FrameView::new(Samples::Eight(&samples[..4]), 2, 2, 3).unwrap_err();
        assert_eq!((error.needed, error.given), (5, 4));
        assert!(FrameView::new(Samples::Eight(&samples), 3, 1, 2).is_err());
    }

    #[test]
    fn the_mean_is_scaled_to_eight_bits() {
        let (dark, bright) = ([0_u16, 4095, 0], [4095_u16, 4095, 1]);
        let view = |samples| FrameView::new(Samples::Sixteen(samples), 3, 1, 3).unwrap();
        assert_eq!(mean(&[view(&dark), view(&bright)], 4095), [128, 255, 0]);
    }
}
