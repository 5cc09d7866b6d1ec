//! What a gauge of deviation makes of a map of deviations, for people.

use super::plan::Production;
use super::squares::extreme::least_support;
use super::strip::Strips;
use crate::inspect::table::IntegralTable;
use alloc::vec;
use alloc::vec::Vec;

impl Production {
    /// The mean deviation over the square about each pixel for a gauge of squares of `side` pixels,
    /// mm, from [`Maps::deviation`](super::Maps::deviation) of what was inspected last in these
    /// strips. NaN where a gauge would not look: the middle is not compared, less than half of the
    /// square is, or the middle lies outside of the regions, moved with the part, that gauges
    /// compare with golden. Without such gauges there are means wherever the part is compared.
    ///
    /// The largest in a gauge's region is its reading, up to the rounding of `deviation`:
    /// `the_map_of_square_means_has_the_reading_of_the_gauge_at_its_place`.
    pub fn square_means(&self, strips: &Strips, deviation: &[f32], side: usize) -> Vec<f32> {
        let width = self.golden.size().0;
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
                let side = self.golden.taught.side(place, side);
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
        let regions = comparing.filter_map(|(at, _)| self.gauges.region(&strips.pose, at));
        for place in regions.flat_map(|region| region.places(self.golden.size().0)) {
            inside[place] = true;
        }
        inside
    }
}
