//! Maps of the whole frame, for people: written on request, and what a gauge of deviation makes of
//! them.

use super::squares::extreme::least_support;
use super::{Production, Strips};
use crate::inspect::table::IntegralTable;
use alloc::vec;
use alloc::vec::Vec;

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

impl Production {
    /// The mean deviation over the square about each pixel for a gauge of squares of `side` pixels,
    /// mm, from [`Maps::deviation`] of what was inspected last in these strips. NaN where a gauge
    /// would not look: the middle is not compared, less than half of the square is, or the middle
    /// lies outside of the regions, moved with the part, that gauges compare with golden. Without
    /// such gauges there are means wherever the part is compared.
    ///
    /// The largest in a gauge's region is its reading, up to the rounding of `deviation`:
    /// `the_map_of_square_means_has_the_reading_of_the_gauge_at_its_place`.
    pub fn square_means(&self, strips: &Strips, deviation: &[f32], side: usize) -> Vec<f32> {
        let width = self.size().0;
        let sums = IntegralTable::new(width, deviation.len(), |place| {
            let mm = deviation[place];
            mm.is_finite().then_some([1.0, f64::from(mm)])
        });
        let shown = self.compared_regions(strips, deviation.len());
        let means = deviation.iter().zip(shown).enumerate();
        means
            .map(|(place, (mm, shown))| {
                if !(shown && mm.is_finite()) {
                    return f32::NAN;
                }
                let side = self.taught.side(place, side);
                let [count, sum] = sums.square(place / width, place % width, side);
                match count > 0.0 && count >= least_support(side) as f64 {
                    true => (sum / count) as f32,
                    false => f32::NAN,
                }
            })
            .collect()
    }

    /// Which of so many pixels lie in a region that a gauge compares with golden; all if there is
    /// no such gauge.
    fn compared_regions(&self, strips: &Strips, pixels: usize) -> Vec<bool> {
        let gauges = self.gauges.list.iter().enumerate();
        let mut comparing = gauges
            .filter(|(_, gauge)| gauge.measure.facts().compares)
            .peekable();
        let mut inside = vec![comparing.peek().is_none(); pixels];
        for (at, _) in comparing {
            for place in strips.pose.region(self, at).places(self.size().0) {
                inside[place] = true;
            }
        }
        inside
    }
}
