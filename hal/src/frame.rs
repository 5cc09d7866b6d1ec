//! One camera image: its format, its samples and its time stamp.

use std::sync::Arc;

use crate::error::Error;
use crate::units::Timestamp;

/// Shape and depth of a camera's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameFormat {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples from the start of one row to the start of the next; at least `width`.
    pub stride: usize,
    /// Significant bits of a sample, 8…16; a sample is 0…2^bits − 1.
    pub bit_depth: u8,
}

impl FrameFormat {
    /// A format without padding between its rows.
    #[must_use]
    pub fn packed(width: u32, height: u32, bit_depth: u8) -> Self {
        Self {
            width,
            height,
            stride: width as usize,
            bit_depth,
        }
    }

    /// Samples that a buffer of this format holds.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.stride * self.height as usize
    }

    /// The largest sample, 2^bits − 1.
    #[must_use]
    pub fn full_scale(&self) -> u16 {
        u16::try_from((1_u32 << u32::from(self.bit_depth.min(16))) - 1).unwrap_or(u16::MAX)
    }

    /// "512×512 pixels of 8 bit", for messages.
    #[must_use]
    pub fn describe(&self) -> String {
        format!(
            "{}×{} pixels of {} bit",
            self.width, self.height, self.bit_depth
        )
    }
}

/// The samples of a frame, row by row, `stride` samples per row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Samples<'a> {
    /// Samples of a camera of 8 bits.
    Eight(&'a [u8]),
    /// Samples of a camera of 9 to 16 bits.
    Sixteen(&'a [u16]),
}

/// A buffer that owns the samples of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// Samples of a camera of 8 bits.
    Eight(Vec<u8>),
    /// Samples of a camera of 9 to 16 bits.
    Sixteen(Vec<u16>),
}

impl Pixels {
    /// A zeroed buffer for frames of `format`.
    #[must_use]
    pub fn zeroed(format: &FrameFormat) -> Self {
        if format.bit_depth == 8 {
            Self::Eight(vec![0; format.samples()])
        } else {
            Self::Sixteen(vec![0; format.samples()])
        }
    }

    fn samples(&self) -> Samples<'_> {
        match self {
            Self::Eight(samples) => Samples::Eight(samples),
            Self::Sixteen(samples) => Samples::Sixteen(samples),
        }
    }
}

/// One camera image. Clones share the samples; a frame may be kept while others arrive.
#[derive(Clone, Debug)]
pub struct Frame {
    format: FrameFormat,
    pixels: Arc<Pixels>,
    timestamp: Timestamp,
    count: u64,
}

impl Frame {
    /// A frame of `format` whose exposure started at `timestamp`, the `count`-th of its camera.
    ///
    /// # Errors
    /// `Unsupported` if the format has no pixels, a stride below its width or a depth outside 8…16,
    /// or if `pixels` does not have the format's number and kind of samples.
    pub fn new(
        format: FrameFormat,
        pixels: Arc<Pixels>,
        timestamp: Timestamp,
        count: u64,
    ) -> Result<Self, Error> {
        let fits = match pixels.samples() {
            Samples::Eight(samples) => format.bit_depth == 8 && samples.len() == format.samples(),
            Samples::Sixteen(samples) => format.bit_depth != 8 && samples.len() == format.samples(),
        };
        let sane = format.width > 0
            && format.height > 0
            && format.stride >= format.width as usize
            && (8..=16).contains(&format.bit_depth);
        if !sane || !fits {
            return Err(Error::unsupported(
                format!(
                    "a frame of {} with {} samples per row",
                    format.describe(),
                    format.stride
                ),
                "give a buffer of stride × height samples, bytes for 8 bit and words for 9 to 16 bit",
            ));
        }
        Ok(Self {
            format,
            pixels,
            timestamp,
            count,
        })
    }

    /// Shape and depth.
    #[must_use]
    pub fn format(&self) -> FrameFormat {
        self.format
    }

    /// The samples, without a copy.
    #[must_use]
    pub fn samples(&self) -> Samples<'_> {
        self.pixels.samples()
    }

    /// The samples without padding, row by row.
    #[must_use]
    pub fn counts(&self) -> Vec<f32> {
        let (width, stride) = (self.format.width as usize, self.format.stride);
        match self.samples() {
            Samples::Eight(all) => rows(all, width, stride),
            Samples::Sixteen(all) => rows(all, width, stride),
        }
    }

    /// Start of the exposure.
    #[must_use]
    pub fn timestamp(&self) -> Timestamp {
        self.timestamp
    }

    /// The camera's own count of frames; a gap means a lost frame.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The same samples with another time and count, as needed to replay a recorded frame.
    #[must_use]
    pub fn restamped(&self, timestamp: Timestamp, count: u64) -> Self {
        Self {
            timestamp,
            count,
            ..self.clone()
        }
    }
}

/// Buffers that are used again when no frame refers to them any more.
///
/// As long as no more frames are kept at a time than before, taking a buffer allocates nothing.
#[derive(Debug)]
pub struct Pool {
    format: FrameFormat,
    buffers: Vec<Arc<Pixels>>,
    limit: usize,
}

impl Pool {
    /// An empty pool for frames of `format` that remembers at most `limit` buffers.
    #[must_use]
    pub fn new(format: FrameFormat, limit: usize) -> Self {
        Self {
            format,
            buffers: Vec::with_capacity(limit),
            limit,
        }
    }

    /// Gives the memory of all free buffers back.
    pub fn release(&mut self) {
        self.buffers.retain(|buffer| Arc::strong_count(buffer) > 1);
    }

    /// Fills a free buffer with `write` and makes a frame of it. The buffer's content before that
    /// is undefined.
    ///
    /// # Errors
    /// As [`Frame::new`], if the pool's format is invalid.
    pub fn frame(
        &mut self,
        timestamp: Timestamp,
        count: u64,
        write: impl FnOnce(&mut Pixels),
    ) -> Result<Frame, Error> {
        let free = self
            .buffers
            .iter_mut()
            .find(|buffer| Arc::strong_count(buffer) == 1);
        if let Some(buffer) = free
            && let Some(pixels) = Arc::get_mut(buffer)
        {
            write(pixels);
            return Frame::new(self.format, buffer.clone(), timestamp, count);
        }
        let mut pixels = Pixels::zeroed(&self.format);
        write(&mut pixels);
        let buffer = Arc::new(pixels);
        if self.buffers.len() < self.limit {
            self.buffers.push(Arc::clone(&buffer));
        }
        Frame::new(self.format, buffer, timestamp, count)
    }
}

fn rows<T: Copy + Into<f32>>(all: &[T], width: usize, stride: usize) -> Vec<f32> {
    let mut counts = Vec::with_capacity(all.len());
    for row in all.chunks(stride.max(1)) {
        counts.extend(row.iter().take(width).map(|sample| (*sample).into()));
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(pool: &mut Pool, value: u8) -> Frame {
        pool.frame(Timestamp(u64::from(value)), u64::from(value), |pixels| {
            if let Pixels::Eight(samples) = pixels {
                samples.fill(value);
            }
        })
        .unwrap()
    }

    #[test]
    fn a_pool_uses_a_buffer_again_once_its_frame_is_dropped_and_not_before() {
        let mut pool = Pool::new(FrameFormat::packed(4, 3, 8), 8);
        let kept = filled(&mut pool, 7);
        for value in 0..100 {
            filled(&mut pool, value);
        }
        assert_eq!(
            pool.buffers.len(),
            2,
            "one kept frame and one in flight need two buffers"
        );
        assert_eq!(kept.samples(), Samples::Eight(&[7; 12]));
    }

    #[test]
    fn a_frame_whose_buffer_does_not_fit_its_format_is_refused() {
        let format = FrameFormat::packed(4, 3, 10);
        for pixels in [Pixels::Eight(vec![0; 12]), Pixels::Sixteen(vec![0; 11])] {
            assert!(Frame::new(format, Arc::new(pixels), Timestamp(0), 0).is_err());
        }
        assert!(Frame::new(format, Arc::new(Pixels::zeroed(&format)), Timestamp(0), 0).is_ok());
        let bent = FrameFormat {
            stride: 3,
            ..format
        };
        assert!(Frame::new(bent, Arc::new(Pixels::zeroed(&bent)), Timestamp(0), 0).is_err());
    }

    #[test]
    fn full_scale_is_the_largest_sample_of_the_depth() {
        for (bits, largest) in [(8, 255), (10, 1023), (12, 4095), (16, 65535)] {
            assert_eq!(FrameFormat::packed(1, 1, bits).full_scale(), largest);
        }
    }

    #[test]
    fn a_frame_can_be_shared_between_threads_and_a_head_moved_to_one() {
        fn shared<T: Send + Sync + Clone>() {}
        fn moved<T: Send>() {}
        shared::<Frame>();
        moved::<crate::head::Head>();
    }
}
