//! A whole measured height map against the golden one, pixel by pixel: deviation and coverage of
//! regions. Production by strips is compared with it.

use algo::inspect::{Factor, Reading, Region, Square, Weight, normal_shares};
use algo::pipeline::{HeightMap, KnownSurface, Window};
use algo::units::Height;
use appliance::recipe::Recipe;
use appliance::recipe::plan::Plan;

/// The part as taught, row-major over the camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Golden {
    /// Pixels per row.
    pub width: usize,
    /// Height as taught, [`Height::UNKNOWN`] where the part is not to be compared.
    pub height: Vec<Height>,
    /// What height differences there are multiplied by: their share along the normal times their
    /// weight.
    pub factor: Vec<f64>,
    /// The least side of the squares about each pixel; empty where any will do.
    pub sides: Vec<u8>,
}

/// A measured height map beside the golden one. Places that only one of them knows do not count.
#[derive(Clone, Debug)]
pub(crate) struct Comparison<'a> {
    golden: &'a Golden,
    measured: &'a HeightMap,
    /// Weighted deviation along the normal in nm and its variance in nm² of each pixel that both
    /// maps know.
    deviations: Vec<Option<(i64, f64)>>,
}

/// A mean over a square needs at least this share of its pixels.
const MIN_SUPPORT: f64 = 0.5;

impl<'a> Comparison<'a> {
    /// Compares two maps of the same size.
    pub fn new(golden: &'a Golden, measured: &'a HeightMap) -> Self {
        let places = 0..golden.height.len();
        Self {
            golden,
            measured,
            deviations: places.map(|place| at(golden, measured, place)).collect(),
        }
    }

    /// The mean weighted deviation over a square of `side` pixels around a place, in mm, and its σ.
    fn smoothed(&self, row: usize, column: usize, side: usize) -> Option<Reading> {
        let (width, half) = (self.golden.width, side / 2);
        let columns = column.saturating_sub(half)..(column + half + 1).min(width);
        let rows = self.deviations.chunks(width).skip(row.saturating_sub(half));
        let (mut sum, mut variance, mut count) = (0, 0.0, 0);
        for row in rows.take(row + half + 1 - row.saturating_sub(half)) {
            for (deviation, noise) in row[columns.clone()].iter().flatten() {
                sum += deviation;
                variance += noise;
                count += 1;
            }
        }
        let count = f64::from(count);
        if count < MIN_SUPPORT * (side * side) as f64 {
            return None;
        }
        let sigma = variance.sqrt() / count / 1e6;
        Some(Reading {
            value: sum as f64 / count / 1e6,
            sigma: (sigma > 0.0).then_some(sigma),
            expected: None,
            systematic: 0.0,
            compared: 0.0,
            rims: 0.0,
            square: Some(Square { column, row, side }),
        })
    }

    /// The deviation from golden of largest magnitude in a region, with its sign, each pixel's
    /// times its weight, after averaging over squares of `side` pixels (odd; 1 = none): single
    /// noisy pixels do not decide. `None` where no square has enough pixels that both maps know.
    pub fn deviation(&self, region: &Region, side: usize) -> Option<Reading> {
        let places = region
            .spans()
            .iter()
            .flat_map(|(row, columns)| columns.clone().map(move |column| (*row, column)));
        places
            .filter(|(row, column)| {
                let place = row * self.golden.width + column;
                self.deviations[place].is_some()
            })
            .filter_map(|(row, column)| {
                let least = self.golden.sides.get(row * self.golden.width + column);
                let side = least.map_or(side, |least| side.max(usize::from(*least)));
                self.smoothed(row, column, side)
            })
            .max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()))
    }

    /// The share of a region's pixels that the measurement resolves. What noise does to it is not
    /// known here.
    pub fn coverage(&self, region: &Region) -> Reading {
        let resolved = region
            .places(self.golden.width)
            .filter(|&place| self.measured.height[place].is_known())
            .count();
        Reading {
            value: resolved as f64 / region.len().max(1) as f64,
            sigma: None,
            expected: None,
            systematic: 0.0,
            compared: 0.0,
            rims: 0.0,
            square: None,
        }
    }

    /// The share of what the golden map knows inside a window that the measurement resolves.
    pub fn golden_coverage(&self, window: Window<'_>) -> f64 {
        let (mut known, mut both) = (0_usize, 0_usize);
        for (row, columns) in window.iter().enumerate() {
            for place in columns
                .clone()
                .map(|column| row * self.golden.width + column)
            {
                if self.golden.height[place].is_known() {
                    known += 1;
                    both += usize::from(self.measured.height[place].is_known());
                }
            }
        }
        both as f64 / known.max(1) as f64
    }
}

/// Weighted deviation in nm and its variance in nm² (0 where the noise is not known).
fn at(golden: &Golden, measured: &HeightMap, place: usize) -> Option<(i64, f64)> {
    let (taught, height) = (golden.height[place], measured.height[place]);
    if !(taught.is_known() && height.is_known()) {
        return None;
    }
    let factor = golden.factor[place];
    let sigma = f64::from(measured.sigma[place]) * 1e6 * factor;
    let variance = if sigma.is_finite() {
        sigma * sigma
    } else {
        0.0
    };
    let deviation = f64::from(height.nm() - taught.nm()) * factor;
    Some((deviation.round() as i64, variance))
}

/// What height differences are multiplied by: the share along golden's normal times the weight.
pub(crate) fn factors(recipe: &Recipe, plan: &Plan, height: &[Height]) -> Vec<f64> {
    let valid = &recipe.arrays.valid;
    let surface = KnownSurface {
        width: recipe.conditions.camera.0 as usize,
        phase: Vec::new(),
        height: height.to_vec(),
    };
    let shares = normal_shares(plan.production().triangulator(), &surface);
    let factors = valid.iter().zip(shares).map(|(&bits, share)| {
        let weight = Weight::from_bits(bits).share();
        Factor::of(weight * f64::from(share)).number()
    });
    factors.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 40;

    fn flat() -> (Golden, HeightMap, Region) {
        let golden = Golden {
            width: WIDTH,
            height: vec![Height::from_nm(0); WIDTH * WIDTH],
            factor: vec![1.0; WIDTH * WIDTH],
            sides: Vec::new(),
        };
        let measured = HeightMap {
            width: WIDTH,
            height: vec![Height::from_nm(10_000); WIDTH * WIDTH],
            sigma: vec![0.04; WIDTH * WIDTH],
        };
        let side = WIDTH as f64;
        let corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)];
        (
            golden,
            measured,
            Region::polygon(&corners, WIDTH, WIDTH).unwrap(),
        )
    }

    #[test]
    fn a_dent_is_found_with_its_sign_and_a_single_wild_pixel_is_not() {
        let (golden, mut measured, region) = flat();
        measured.height[5 * WIDTH + 5] = Height::from_mm(3.0);
        for row in 20..27 {
            for column in 20..27 {
                measured.height[row * WIDTH + column] = Height::from_mm(-0.5);
            }
        }
        let comparison = Comparison::new(&golden, &measured);
        let dent = comparison.deviation(&region, 7).unwrap();
        assert!((dent.value + 0.5).abs() < 1e-9, "{dent:?}");
        // 49 pixels of 0.04 mm.
        assert!((dent.sigma.unwrap() - 0.04 / 7.0).abs() < 1e-7);
        let raw = comparison.deviation(&region, 1).unwrap();
        assert!((raw.value - 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_dent_in_weighted_pixels_counts_times_their_weight_and_so_does_their_noise() {
        let (mut golden, mut measured, region) = flat();
        for row in 20..27 {
            for column in 20..27 {
                measured.height[row * WIDTH + column] = Height::from_mm(-0.5);
                golden.factor[row * WIDTH + column] = 0.25;
            }
        }
        let dent = Comparison::new(&golden, &measured)
            .deviation(&region, 7)
            .unwrap();
        assert!((dent.value + 0.125).abs() < 1e-9, "{dent:?}");
        assert!((dent.sigma.unwrap() - 0.01 / 7.0).abs() < 1e-7);
    }

    #[test]
    fn coverage_counts_resolved_pixels_of_the_region_and_of_golden() {
        let (mut golden, mut measured, region) = flat();
        for place in 0..WIDTH * WIDTH / 4 {
            measured.height[place] = Height::UNKNOWN;
        }
        golden.height[..WIDTH * WIDTH / 2].fill(Height::UNKNOWN);
        let comparison = Comparison::new(&golden, &measured);
        assert_eq!(comparison.coverage(&region).value, 0.75);
        let window = vec![0..WIDTH; WIDTH];
        assert_eq!(comparison.golden_coverage(&window), 1.0);
        let mut top = vec![0..0; WIDTH];
        top[WIDTH / 2] = 3..9;
        assert_eq!(comparison.golden_coverage(&top), 1.0);
    }

    #[test]
    fn where_nothing_can_be_compared_there_is_no_deviation() {
        let (golden, mut measured, region) = flat();
        measured.height.fill(Height::UNKNOWN);
        let comparison = Comparison::new(&golden, &measured);
        assert_eq!(comparison.deviation(&region, 3), None);
        assert_eq!(comparison.coverage(&region).value, 0.0);
    }
}
