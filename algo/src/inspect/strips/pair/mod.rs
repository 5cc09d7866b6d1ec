//! Measuring with a pair of frames, the fringe and its complement, about the golden part.
//!
//! 1. **picture** (`align/picture.rs`): the mean of both frames has no fringes; its edges tell where the
//!    part lies.
//! 2. **expected** (`expected`): the phase that golden would have there.
//! 3. **window** (`window`): half the difference is the fringe alone; fitted in a window about each
//!    pixel, it gives the phase.
//! 4. The part's motion is found from these phases as from those of any sequence, in all six
//!    components; those that the shape does not determine keep what the picture has found. Then
//!    stages 2 and 3 are repeated with it, and their map goes through the ordinary inspection
//!    ([`Input::Phases`](super::Input::Phases)).
//!
//! Neighbouring phases share pixels. Their σ is therefore that of the two samples of the pixel
//! alone, which is right for means over areas that are large against the window; means over smaller
//! squares are less noisy (`sums`).

pub mod expected;
mod phases;
mod solve;
pub mod sums;
mod window;

pub use phases::PairBuffers;

pub use expected::Expectation;
pub use sums::{correlated, smoothed};

#[cfg(test)]
mod tests;
