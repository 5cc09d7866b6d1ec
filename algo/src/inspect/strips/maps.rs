//! Maps of the whole frame, for people, written on request.
//!
//! The map of the deviation shows what the gauge got: `square_means` averages over the gauge's
//! squares.

/// Maps that an inspection writes, each as long as a frame, row-major, NaN where there is no value.
#[derive(Debug, Default)]
pub struct Maps<'a> {
    /// z in mm of each pixel with a height, as the part lies.
    pub heights: Option<&'a mut [f32]>,
    /// Deviation from golden along its normal in mm of each pixel that is compared, as the squares
    /// of a gauge get it: the part's motion taken back, times golden's weight.
    pub deviation: Option<&'a mut [f32]>,
}

impl<'a> Maps<'a> {
    /// Whether nothing is to be written.
    pub(super) fn is_empty(&self) -> bool {
        self.heights.is_none() && self.deviation.is_none()
    }

    /// Those of one part of the frame after the other, of so many pixels each.
    pub(super) fn split(self, pixels: usize) -> impl Iterator<Item = Self> {
        let parts = |map: Option<&'a mut [f32]>| map.map(|map| map.chunks_mut(pixels));
        let (mut heights, mut deviation) = (parts(self.heights), parts(self.deviation));
        core::iter::from_fn(move || {
            let maps = Self {
                heights: heights.as_mut().and_then(Iterator::next),
                deviation: deviation.as_mut().and_then(Iterator::next),
            };
            (!maps.is_empty()).then_some(maps)
        })
    }
}
