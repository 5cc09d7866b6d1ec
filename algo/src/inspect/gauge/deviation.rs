//! The deviation from golden of largest magnitude.

use super::kind::*;

kind! {
    /// The mean weighted deviation from golden along its normal of largest magnitude, positive
    /// outwards, of the squares of `smoothing_px` pixels about every pixel, mm (profile of a
    /// surface, ISO 1101:2017): single noisy pixels do not decide. Squares of which less than half
    /// can be compared do not count.
    Deviation {
        /// Side of the squares, pixels, odd; 1 = single pixels.
        smoothing_px: usize = Domain::Pixels { odd: true },
    }
}

impl Kind for Deviation {
    fn facts(&self) -> Facts {
        Facts {
            words: "over {smoothing_px} px",
            compares: true,
            ..Facts::new(Basis::Squares(self.smoothing_px), SURFACE)
        }
    }
}
