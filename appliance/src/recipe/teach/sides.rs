//! The side of the square about each pixel whose mean deviation is compared: as small as noise and
//! golden's interpolation allow there.
//!
//! A small deep defect is seen at its depth only in squares that are no larger than it. Where
//! heights are noisy, or where golden is bent and so deviates from itself when it is displaced,
//! only larger squares keep good parts inside the limits. Both differ from place to place, so the
//! side does: on a cone squares are large at its tip and its rim alone.

/// Sides of squares in camera pixels, the smallest first. A single pixel may be a wild one. In the
/// largest a dent of 8 mm is still seen at half its depth by 0.4 mm per pixel.
pub(crate) const SIDES: [usize; 4] = [3, 5, 7, 9];
/// The largest deviation of good parts is to stay below this share of the limit.
pub(crate) const ROOM: f64 = 1.0 / 3.0;
/// Squares have at most a σ of the limit by this: of a part with 10⁴ squares of just this σ, one in
/// 10⁶ exceeds the limit.
pub(crate) const SIGMAS: f64 = 6.5;

/// The side that squares have where nothing asks for a larger one, and the least side about each
/// pixel, 0 where no part is compared; empty where all have the smallest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sides {
    pub smallest: usize,
    pub least: Vec<u8>,
}

/// The side of squares about pixels for which no smaller square is good enough.
const LARGEST: usize = SIDES[SIDES.len() - 1];
/// What is missed of golden between its pixels is to stay below this share of the limit: beside
/// creases parts deviate by twice as much, as golden knows only what its pixels
/// see of a crease, and noise comes on top.
const PLACED: f64 = 0.1;
/// A side other than the largest is used only if at least this share of the compared pixels has it:
/// each side takes time in every cycle.
const WORTH: f64 = 0.01;

impl Sides {
    /// The largest side everywhere.
    pub fn largest() -> Self {
        Self {
            smallest: LARGEST,
            least: Vec::new(),
        }
    }

    /// Sides as small as they may be for a limit in mm, in a frame of `width` columns: `sigmas` are
    /// σ of the means over squares of each of [`SIDES`] in mm, NaN where there is no square;
    /// `missed` is what displaced golden deviates by in a square of a side about a pixel, mm. Only
    /// pixels that count in full, as `full` says, have smaller sides than the largest; the image of
    /// a part moves by up to `away` pixels.
    pub fn new(
        (sigmas, missed): (&[Vec<f32>; SIDES.len()], impl Fn(usize, usize) -> f64),
        full: impl Fn(usize) -> Option<bool>,
        limit: f64,
        (width, away): (usize, usize),
    ) -> Self {
        let quiet = |side: usize, place: usize| {
            // NaN is not above.
            let noisy = f64::from(sigmas[side][place]) * SIGMAS > ROOM * limit;
            !noisy && missed(place, SIDES[side]) < PLACED * limit
        };
        let own = |place: usize| match full(place) {
            None => 0,
            Some(false) => LARGEST as u8,
            Some(true) => {
                let side = (0..SIDES.len()).find(|&side| quiet(side, place));
                side.map_or(LARGEST, |side| SIDES[side]) as u8
            }
        };
        let pixels = sigmas[0].len();
        let least: Vec<u8> = (0..pixels).map(own).collect();
        Self::worth_it(dilated(&least, width, away))
    }

    /// These sides without those that hardly any pixel has: such pixels get the next larger side.
    fn worth_it(mut least: Vec<u8>) -> Self {
        let all = least.iter().filter(|side| **side > 0).count() as f64;
        for sides in SIDES.windows(2) {
            let own = least
                .iter_mut()
                .filter(|side| usize::from(**side) == sides[0]);
            let own: Vec<&mut u8> = own.collect();
            if (own.len() as f64) < WORTH * all {
                own.into_iter().for_each(|side| *side = sides[1] as u8);
            }
        }
        let known = || {
            least
                .iter()
                .map(|side| usize::from(*side))
                .filter(|side| *side > 0)
        };
        let smallest = known().min().unwrap_or(LARGEST);
        if known().all(|side| side == smallest) {
            least = Vec::new();
        }
        Self { smallest, least }
    }

    /// The side about a pixel.
    pub fn at(&self, place: usize) -> usize {
        let least = self.least.get(place).copied().unwrap_or_default();
        self.smallest.max(usize::from(least))
    }

    /// The most that is missed in these squares of the places that are compared, mm.
    pub fn most(
        &self,
        missed: impl Fn(usize, usize) -> f64,
        places: impl Iterator<Item = usize>,
    ) -> f64 {
        let most = places.map(|place| missed(place, self.at(place)));
        most.fold(0.0, f64::max)
    }

    /// All sides that there are, the smallest first.
    pub fn all(&self) -> Vec<usize> {
        let larger = SIDES.into_iter().filter(|side| *side > self.smallest);
        let larger = larger.filter(|side| self.least.contains(&(*side as u8)));
        std::iter::once(self.smallest).chain(larger).collect()
    }
}

/// The largest value within so many columns and rows of each pixel.
fn dilated(values: &[u8], width: usize, by: usize) -> Vec<u8> {
    let width = width.max(1);
    let rows = values.len() / width;
    let near = |at: usize, end: usize| at.saturating_sub(by)..(at + by + 1).min(end);
    let mut along = vec![0; values.len()];
    for (out, row) in along.chunks_mut(width).zip(values.chunks(width)) {
        for (column, out) in out.iter_mut().enumerate() {
            *out = row[near(column, width)].iter().copied().max().unwrap_or(0);
        }
    }
    let mut all = vec![0; values.len()];
    for (row, out) in all.chunks_mut(width).enumerate() {
        for above in near(row, rows) {
            for (out, &value) in out.iter_mut().zip(&along[above * width..][..width]) {
                *out = value.max(*out);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 40;
    const PIXELS: usize = WIDTH * WIDTH;

    /// σ of all sides where that of a pixel is as given.
    fn sigmas(pixel: impl Fn(usize) -> f32) -> [Vec<f32>; SIDES.len()] {
        SIDES.map(|side| (0..PIXELS).map(|at| pixel(at) / side as f32).collect())
    }

    #[test]
    fn squares_are_large_only_where_noise_or_a_displaced_part_asks_for_it() {
        let quiet = sigmas(|_| 0.01);
        let everywhere = |_: usize| Some(true);
        let none = |_, _| 0.0;
        let new = |sigmas, away| Sides::new((sigmas, none), everywhere, 0.15, (WIDTH, away));
        let all = Sides {
            smallest: 3,
            least: Vec::new(),
        };
        assert_eq!(new(&quiet, 2), all);
        // One row is noisy: about it, as far as a part moves, squares are the largest.
        let noisy = sigmas(|at| if at / WIDTH == 20 { 0.1 } else { 0.01 });
        let sides = new(&noisy, 2);
        let rows: Vec<usize> = (0..WIDTH).map(|row| sides.at(row * WIDTH + 5)).collect();
        let expected = |row: usize| if (18..=22).contains(&row) { 9 } else { 3 };
        assert_eq!(rows, (0..WIDTH).map(expected).collect::<Vec<_>>());
        // A crease is seen in small squares more than in large ones.
        let crease = |place, side| if place == 0 { 0.1 / side as f64 } else { 0.0 };
        let sides = Sides::new((&quiet, crease), everywhere, 0.15, (WIDTH, 0));
        // Seven would do, but one pixel is not worth a side of its own.
        assert_eq!((sides.at(0), sides.at(1)), (9, 3));
        // All pixels are alike, and too noisy.
        let everywhere = new(&sigmas(|_| 0.1), 0);
        assert_eq!(everywhere, Sides::largest());
    }

    #[test]
    fn few_pixels_are_not_worth_a_side_of_their_own() {
        let mut least = vec![3; 1000];
        least[600..].fill(5);
        least[900..].fill(7);
        least[999] = 0;
        let sides = Sides::worth_it(least);
        assert_eq!(sides.all(), [3, 5, 7]);
        assert_eq!([0, 700, 950, 999].map(|at| sides.at(at)), [3, 5, 7, 3]);
        let mut least = vec![9; 1000];
        least[0] = 3;
        least[1] = 7;
        assert_eq!(Sides::worth_it(least), Sides::largest());
    }
}
