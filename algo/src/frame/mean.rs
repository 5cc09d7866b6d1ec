//! The mean of frames: a picture of the scene without fringes.

use super::{FrameView, Samples};
use alloc::vec;
use alloc::vec::Vec;

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
            match frame.row(v) {
                Samples::Eight(row) => add(&mut sums, row),
                Samples::Sixteen(row) => add(&mut sums, row),
            }
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
    fn the_mean_is_scaled_to_eight_bits() {
        let (dark, bright) = ([0_u16, 4095, 0], [4095_u16, 4095, 1]);
        let view = |samples| FrameView::new(Samples::Sixteen(samples), 3, 1, 3).unwrap();
        assert_eq!(mean(&[view(&dark), view(&bright)], 4095), [128, 255, 0]);
    }
}
