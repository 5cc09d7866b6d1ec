//! The mean of several frames of a scene that does not move, with 16 bits. Where one of the samples
//! of a pixel was at full scale, so is its mean.

use crate::error::Error;
use crate::frame::{Frame, FrameFormat, Pixels, Samples};
use crate::units::Timestamp;
use std::sync::Arc;

/// Number of frames that are averaged.
pub const CAPTURES: usize = 4;
/// Bits of the samples that are summed; the samples of a camera with more bits lose their last
/// ones. The sum of four samples is less than [`SATURATED`].
const BITS: u8 = 14;
/// The sum where one of the samples was at full scale.
const SATURATED: u16 = u16::MAX;

/// The sum of the frames of a pattern, of which nothing else is kept.
#[derive(Debug)]
pub struct Sum {
    /// The sums, without padding between the rows.
    samples: Vec<u16>,
    /// Format, time and count of the first frame.
    format: FrameFormat,
    stamp: (Timestamp, u64),
}

impl Sum {
    /// Of none of the frames that are like this first one.
    pub fn new(first: &Frame) -> Self {
        let format = first.format();
        let samples = vec![0; format.width as usize * format.height as usize];
        let stamp = (first.timestamp(), first.count());
        Self {
            samples,
            format,
            stamp,
        }
    }

    /// Adds one of [`CAPTURES`] frames of this format.
    pub fn add(&mut self, frame: &Frame) {
        match frame.samples() {
            Samples::Eight(samples) => self.add_samples(samples, frame.format()),
            Samples::Sixteen(samples) => self.add_samples(samples, frame.format()),
        }
    }

    fn add_samples<T: Copy + Into<u16>>(&mut self, samples: &[T], format: FrameFormat) {
        let (width, full_scale) = (format.width as usize, format.full_scale());
        let shift = format.bit_depth.saturating_sub(BITS);
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

    /// The mean of the [`CAPTURES`] frames that were added, scaled to 16 bits.
    ///
    /// # Errors
    /// As [`Frame::new`].
    pub fn mean(mut self) -> Result<Frame, Error> {
        let (format, (at, count)) = (self.format, self.stamp);
        let full_scale = (1_u32 << format.bit_depth.min(BITS)) - 1;
        let whole = full_scale * CAPTURES as u32;
        for sum in self.samples.iter_mut().filter(|sum| **sum != SATURATED) {
            // At most 32 bits, as the sum is at most `whole`.
            let mean = (u32::from(*sum) * u32::from(u16::MAX) + whole / 2) / whole;
            *sum = mean.min(u32::from(SATURATED) - 1) as u16;
        }
        let format = FrameFormat::packed(format.width, format.height, 16);
        Frame::new(format, Arc::new(Pixels::Sixteen(self.samples)), at, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of rows of three samples, of which the last is padding.
    fn mean(bit_depth: u8, rows: [[u16; 3]; CAPTURES]) -> [u16; 2] {
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
        let mut sum = Sum::new(&frames[0]);
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
            let [most, all] = mean(depth, [[largest - 1, largest, 0]; CAPTURES]);
            let expected = f64::from(largest - 1) / f64::from(largest) * 65_535.0;
            assert!(
                (f64::from(most) - expected).abs() < 4.5 && most < all,
                "{depth}: {most}"
            );
        }
    }
}
