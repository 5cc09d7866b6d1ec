//! One camera frame as borrowed samples.
//!
//! `FrameView::row` is where a frame's stride is dropped: everything that decodes gets slices of
//! whole rows without padding. What reads samples without it (`head/examine/pictures.rs`,
//! `head/means.rs`, `head/live/picture.rs`, the recorder) leaves the padding out by itself.

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
}
