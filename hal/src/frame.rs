//! One camera image: its format, its samples and its time stamp; buffers for many of them, and the mean
//! of several.

use std::sync::Arc;

use crate::error::Error;
use crate::units::Timestamp;

/// Bits of the samples that are summed; the samples of a camera with more bits lose their last
/// ones. The sum of four samples is less than [`SATURATED`].
const SUMMED_BITS: u8 = 14;
/// The sum where one of the samples was at full scale.
const SATURATED: u16 = u16::MAX;

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

/// Buffers that are used again once no frame refers to them.
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

/// The sum of several frames of a scene that does not move, from which follows their mean with 16
/// bits. Where one of the samples of a pixel is at full scale, so is its mean.
#[derive(Debug)]
pub struct FrameSum {
    /// The sums, without padding between the rows.
    samples: Vec<u16>,
    /// Format, time and count of the first frame.
    format: FrameFormat,
    timestamp: Timestamp,
    count: u64,
}

impl FrameSum {
    /// Number of frames that are averaged.
    pub const CAPTURES: usize = 4;

    /// The sum of no frames yet; they will have the format of `first`, and the mean its time and count.
    pub fn new(first: &Frame) -> Self {
        let format = first.format();
        let samples = vec![0; format.width as usize * format.height as usize];
        Self {
            samples,
            format,
            timestamp: first.timestamp(),
            count: first.count(),
        }
    }

    /// Adds one of [`FrameSum::CAPTURES`] frames of this format.
    pub fn add(&mut self, frame: &Frame) {
        match frame.samples() {
            Samples::Eight(samples) => self.add_samples(samples, frame.format()),
            Samples::Sixteen(samples) => self.add_samples(samples, frame.format()),
        }
    }

    fn add_samples<T: Copy + Into<u16>>(&mut self, samples: &[T], format: FrameFormat) {
        let (width, full_scale) = (format.width as usize, format.full_scale());
        let shift = format.bit_depth.saturating_sub(SUMMED_BITS);
        let rows = samples.chunks(format.stride);
        for (sums, row) in self.samples.chunks_mut(width).zip(rows) {
            for (sum, &sample) in sums.iter_mut().zip(row) {
                let sample: u16 = sample.into();
                *sum = match sample < full_scale {
                    true => sum.saturating_add(sample >> shift),
                    false => SATURATED,
                };
            }
        }
    }

    /// The mean of the [`FrameSum::CAPTURES`] frames that were added, scaled to 16 bits.
    ///
    /// # Errors
    /// As [`Frame::new`].
    pub fn mean(mut self) -> Result<Frame, Error> {
        let format = self.format;
        let full_scale = (1_u32 << format.bit_depth.min(SUMMED_BITS)) - 1;
        let whole = full_scale * Self::CAPTURES as u32;
        for sum in self.samples.iter_mut().filter(|sum| **sum != SATURATED) {
            // At most 32 bits, as the sum is at most `whole`.
            let mean = (u32::from(*sum) * u32::from(u16::MAX) + whole / 2) / whole;
            *sum = mean.min(u32::from(SATURATED) - 1) as u16;
        }
        let format = FrameFormat::packed(format.width, format.height, 16);
        let pixels = Arc::new(Pixels::Sixteen(self.samples));
        Frame::new(format, pixels, self.timestamp, self.count)
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

    /// The mean of rows of three samples; the last one is padding.
    fn mean(bit_depth: u8, rows: [[u16; 3]; FrameSum::CAPTURES]) -> [u16; 2] {
        let format = FrameFormat {
            stride: 3,
            ..FrameFormat::packed(2, 1, bit_depth)
        };
        let pixels = |row: [u16; 3]| match bit_depth {
            8 => Pixels::Eight(row.map(|sample| sample as u8).to_vec()),
            _ => Pixels::Sixteen(row.to_vec()),
        };
        let frames =
            rows.map(|row| Frame::new(format, Arc::new(pixels(row)), Timestamp(0), 0).unwrap());
        let mut sum = FrameSum::new(&frames[0]);
        frames.iter().for_each(|frame| sum.add(frame));
        match sum.mean().unwrap().samples() {
            Samples::Sixteen(&[a, b]) => [a, b],
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_mean_has_16_bits_and_is_saturated_where_one_of_its_samples_is() {
        let eight = [[0, 10, 9], [1, 10, 9], [0, 255, 9], [1, 10, 9]];
        // (0 + 1 + 0 + 1) / 4 of 255.
        assert_eq!(
            mean(8, eight),
            [(0.5 * 65_535.0 / 255.0_f64).round() as u16, u16::MAX]
        );
        for (depth, largest) in [(8, 255), (12, 4095), (14, 16_383), (16, u16::MAX)] {
            let [most, all] = mean(depth, [[largest - 1, largest, 0]; FrameSum::CAPTURES]);
            let expected = f64::from(largest - 1) / f64::from(largest) * 65_535.0;
            assert!(
                (f64::from(most) - expected).abs() < 4.5 && most < all,
                "{depth}: {most}"
            );
        }
    }
}
