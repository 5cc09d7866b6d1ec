//! The mean of several captures of a scene that does not move: one frame of 16 bits for each of the
//! patterns that are loaded.

use hal::error::Error;
use hal::frame::{Frame, FrameSum};
use hal::head::Head;
use std::time::Duration;

/// Takes [`FrameSum::CAPTURES`] frames of each of the loaded patterns, and gives their means. Where one of
/// the samples of a pixel was at full scale, so is its mean. `progress` gets the share of the
/// frames taken; it may end the captures by `false`, and then there are no means.
///
/// # Errors
/// The error of the device that failed.
pub fn take(
    head: &mut Head,
    patterns: usize,
    timeout: Duration,
    progress: &dyn Fn(f64) -> bool,
) -> Result<Option<Vec<Frame>>, Error> {
    let indices: Vec<usize> = (0..patterns).collect();
    let mut sums: Vec<FrameSum> = Vec::with_capacity(patterns);
    let mut taken = 0;
    let mut goes_on = progress(0.0);
    for _ in 0..FrameSum::CAPTURES {
        if !goes_on {
            return Ok(None);
        }
        head.acquire(&indices, timeout, &mut |at, frame| {
            if at == sums.len() {
                sums.push(FrameSum::new(&frame));
            }
            if let Some(sum) = sums.get_mut(at) {
                sum.add(&frame);
            }
            taken += 1;
            // A sequence is not interrupted.
            goes_on = progress(taken as f64 / (FrameSum::CAPTURES * patterns) as f64);
        })?;
    }
    let means: Result<_, _> = sums.into_iter().map(FrameSum::mean).collect();
    means.map(Some)
}
