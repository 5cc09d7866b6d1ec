//! Predicts what the deviation gauge reads on good parts, and whether they keep its limit.
//!
//! The limit is the requested tolerance. In squares that are too noisy for it, deviations get less weight,
//! and teaching reports on how much of the surface, and by which factor a deviation must be larger
//! there to be found. If that concerns more than a small share of the pixels, the part cannot be taught
//! with this limit, and teaching says which one could be held.
//!
//! Squares are as small as noise allows about each pixel: their largest deviation on good parts
//! stays below a third of the limit, so that small deep defects are seen at nearly their depth
//! (`sides`). Parts that lie elsewhere than golden deviate by more than noise, as golden is
//! interpolated between pixels: what that misses is worked out (`algo::inspect::Missed`), and
//! teaching tries golden, displaced (`proof`).
//!
//! Leaving such pixels out instead misses nearly all dents among them
//! (`dents_where_pixels_have_weights_are_found_and_would_be_missed_without_these_pixels`).

use super::sides::{SIDES, SIGMAS, Sides};
use crate::recipe::file::GoodPartsFile;
use crate::system::headway::Headway;
use algo::geometry::Triangulator;
use algo::inspect::good::{DeviationNoise, LargestDeviation, areas, leaves_open, motion_variance};
use algo::inspect::{GoldenSurface, Highlights, Largest, Missed, Taught, Weight, normal_shares};
use algo::phase::Trust;
use algo::pipeline::{KnownSurface, PhaseMap};
use algo::units::Modulation;
use std::f64::consts::SQRT_2;

/// Limit of the deviation unless another one is asked for, ± mm.
pub(crate) const DEVIATION_MM: f64 = 0.15;
/// At most this share of the compared pixels counts with less weight or not at all.
const WEIGHED: f64 = 0.05;
/// At most this share of good parts is predicted to exceed the limit.
const BEYOND: f64 = 1e-6;
/// Limits that could be held are rounded up to a multiple of this, mm; each that is tried is wider than the
/// one before by this factor, and at most so many times the one that is asked for.
const STEP_MM: f64 = 0.01;
const WIDER: f64 = 1.1;
const WIDEST: f64 = 20.0;

/// Diameter of a dent, over the side of a square whose mean has nine tenths of the dent's depth: of
/// a depth that falls as cos²(πr/D) the mean over side a is 1 − (π²/6) a²/D².
pub(crate) const DENT: f64 = 4.06;

/// Teaching says that good parts deviate by less than the largest deviation that is expected and so
/// many of its standard deviations.
const SCATTERS: f64 = 3.0;
/// What displaced parts deviate by beside their sharpest creases, as a multiple of what golden's
/// interpolation misses: golden knows only what its pixels see of a crease (parts in front of the
/// simulated head: `tests/suite/every_part.rs`).
pub(crate) const BEND: f64 = 2.0;

/// What is known of the noise of a taught part.
pub(crate) struct Noise<'a> {
    /// The geometry with the part's phase function.
    pub triangulator: &'a Triangulator,
    /// Golden.
    pub surface: KnownSurface,
    /// Its light.
    pub phases: &'a PhaseMap,
    /// σ_z² of pixels in production, mm².
    pub production: Vec<f32>,
    /// The variance of golden's noise, as a share of `production`.
    pub golden: f64,
}

/// The part with the weights that its noise asks for.
pub(crate) struct Weighed {
    /// What good parts deviate by in the largest squares.
    pub found: GoodPartsFile,
    width: usize,
    weights: Vec<Weight>,
    /// The variances of [`DeviationNoise`].
    pixel: Vec<f32>,
    motion: Vec<f32>,
    /// Shares of height differences along the normal.
    shares: Vec<f32>,
}

impl Noise<'_> {
    /// The limit of the deviation for a tolerance, and the weights of the pixels for this limit, in
    /// squares of the largest side. `mask` is not 0 where the part can be compared.
    pub fn weigh(&self, mask: &[u8], tolerance_mm: f64, headway: Headway<'_>) -> Weighed {
        let width = self.surface.width;
        let valid: Vec<bool> = mask.iter().map(|&valid| valid != 0).collect();
        let both = 1.0 + self.golden as f32;
        let shares = normal_shares(self.triangulator, &self.surface);
        headway.done(0.2);
        let along_normal = |(variance, share): (&f32, &f32)| variance * share * share * both;
        let pixel = self.production.iter().zip(&shares).map(along_normal);
        let pixel: Vec<f32> = pixel.collect();
        let still = vec![0.0; valid.len()];
        let mut noise = DeviationNoise {
            width,
            pixel: &pixel,
            motion: &still,
        };
        let full: Vec<Weight> = valid.iter().copied().map(Weight::from).collect();
        let whole = self.taught(&full);
        let whole = self.golden_surface(&whole);
        // The motion is found from pixels that count in full, and which do depends on the motion:
        // each is worked out once.
        let (_, weights) = limited(&noise, &valid, tolerance_mm);
        headway.done(0.35);
        let taught = self.taught(&weights);
        let window = vec![0..width; valid.len() / width.max(1)];
        let mut motion = motion_variance(self.golden_surface(&taught), whole, &window);
        for (variance, share) in motion.iter_mut().zip(&shares) {
            *variance = along_normal((variance, share));
        }
        headway.done(0.6);
        noise.motion = &motion;
        let (limit_mm, weights) = limited(&noise, &valid, tolerance_mm);
        headway.done(0.7);
        let (mut all, mut weighed) = (0.0, 0.0);
        for (area, weight) in areas(whole).into_iter().zip(&weights) {
            let area = f64::from(area);
            all += area;
            weighed += if weight.partial() { area } else { 0.0 };
        }
        headway.done(0.85);
        let compared = weights.iter().filter(|weight| weight.compared());
        let least_weight = compared
            .clone()
            .map(|weight| weight.share())
            .fold(1.0, f64::min);
        let found = GoodPartsFile {
            tolerance_mm,
            limit_mm,
            left_out: 1.0 - compared.count() as f64 / count(&valid).max(1.0),
            weighed: weighed / f64::max(all, f64::MIN_POSITIVE),
            least_weight,
            ..GoodPartsFile::default()
        };
        let mut weighed = Weighed {
            shares,
            found,
            width,
            weights,
            pixel,
            motion,
        };
        let sides = Sides::largest();
        let [sigmas] = weighed.sigmas([sides.smallest]);
        let largest = weighed.predict(&sides, std::iter::once((sides.smallest, sigmas)));
        if largest.beyond(limit_mm) > BEYOND {
            let limit_mm = rounded_up(largest.limit(BEYOND));
            weighed.found.limit_mm = limit_mm;
            weighed.found.beyond = largest.beyond(limit_mm);
        }
        weighed
    }

    /// Whether the heights of these pixels leave open how far the part is moved along some direction.
    pub fn leaves_open(&self, mask: &[u8]) -> bool {
        let full: Vec<Weight> = mask.iter().map(|&valid| Weight::from(valid != 0)).collect();
        let window = vec![0..self.surface.width; mask.len() / self.surface.width.max(1)];
        leaves_open(self.golden_surface(&self.taught(&full)), &window)
    }

    /// Golden with these weights, and with the noise that production takes it to have ([`Taught`]).
    fn taught(&self, weights: &[Weight]) -> Taught {
        let sigmas = self
            .production
            .iter()
            .map(|variance| f64::from(*variance).sqrt());
        // Only the motion is found from this, and the motion is found from heights.
        let pixels = weights.iter().copied().zip(sigmas);
        Taught::new(pixels.map(|(weight, sigma)| (weight, 1.0, sigma)))
    }

    fn golden_surface<'a>(&'a self, taught: &'a Taught) -> GoldenSurface<'a> {
        GoldenSurface {
            triangulator: self.triangulator,
            surface: &self.surface,
            taught,
        }
    }
}

impl Weighed {
    /// The weights of the pixels ([`Weight::bits`]).
    pub fn bits(&self) -> Vec<u8> {
        self.weights.iter().map(|weight| weight.bits()).collect()
    }

    /// The places that are compared.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        let compared = |place: &usize| self.weights[*place].compared();
        (0..self.weights.len()).filter(compared)
    }

    /// Gives the part squares as small as noise and golden's interpolation allow, where the image of
    /// a part moves by up to `away` pixels, and sets what good parts are predicted to deviate by in
    /// them. The second result is what displaced parts deviate by at their sharpest crease or brightest highlight, mm.
    pub fn settle(&mut self, noise: &Noise<'_>, away: usize, headway: Headway<'_>) -> (Sides, f64) {
        let sigmas = self.sigmas(SIDES);
        headway.done(0.3);
        let full = |place: usize| {
            let weight = self.weights[place];
            weight.compared().then_some(!weight.partial())
        };
        let missed = Missed::new(&noise.surface, &self.shares, &self.weights);
        headway.done(0.5);
        let seen = (noise.triangulator, &noise.surface);
        let light = |at: usize| match noise.phases.trust[at] {
            Trust::Saturated => Modulation::from_bits(u16::MAX),
            _ => noise.phases.modulation[at],
        };
        let highlights = Highlights::new(seen, light, &self.shares, &self.weights);
        // Golden has an error of its own, which is independent of the part's.
        let both = |one: f64| one * SQRT_2 / BEND;
        let lit = |place, side| {
            highlights
                .as_ref()
                .map_or(0.0, |of| both(of.at(place, side)))
        };
        let bent = |place, side| missed.at(place, side) + lit(place, side);
        let limit = self.found.limit_mm;
        let sides = Sides::new((&sigmas, &bent), full, limit, (self.width, away));
        headway.done(0.8);
        let bend = sides.most(bent, self.places());
        drop((missed, highlights));
        self.predict(&sides, SIDES.into_iter().zip(sigmas));
        (sides, bend)
    }

    /// Sets what good parts are predicted to deviate by in squares of these sides; returns the
    /// distribution. `sigmas` has σ of the means over all squares of each side, mm.
    fn predict(
        &mut self,
        sides: &Sides,
        sigmas: impl Iterator<Item = (usize, Vec<f32>)>,
    ) -> LargestDeviation {
        let mut largest = LargestDeviation::default();
        let all = sides.all();
        for (side, mut sigmas) in sigmas.filter(|(side, _)| all.contains(side)) {
            for (place, sigma) in sigmas.iter_mut().enumerate() {
                if sides.at(place) != side {
                    *sigma = f32::NAN;
                }
            }
            largest.add(LargestDeviation::new(&sigmas, self.width, side));
        }
        let wider = self
            .places()
            .filter(|place| sides.at(*place) > sides.smallest);
        let (wider, places) = (wider.count(), self.places().count());
        let found = &mut self.found;
        (found.largest_mm, found.scatter_mm) = largest.mean_and_scatter();
        found.beyond = largest.beyond(found.limit_mm);
        found.smoothing_px = sides.smallest;
        let widest = all.into_iter().max();
        found.wider_px = widest.filter(|side| *side > sides.smallest).unwrap_or(0);
        found.wider = wider as f64 / places.max(1) as f64;
        largest
    }

    /// σ of the means over the squares of these sides about each pixel, mm; NaN where there is
    /// none.
    fn sigmas<const N: usize>(&self, sides: [usize; N]) -> [Vec<f32>; N] {
        let noise = DeviationNoise {
            width: self.width,
            pixel: &self.pixel,
            motion: &self.motion,
        };
        noise.of_squares(&self.weights, sides)
    }
}

/// The limit, at least the tolerance, that all but [`WEIGHED`] of the pixels can hold, and the
/// weights with which the others can.
fn limited(noise: &DeviationNoise<'_>, valid: &[bool], tolerance_mm: f64) -> (f64, Vec<Weight>) {
    let side = SIDES[SIDES.len() - 1];
    let least = (1.0 - WEIGHED) * count(valid);
    let mut limit = tolerance_mm;
    loop {
        let weights = noise.weights(valid, side, limit / SIGMAS);
        let full = weights.iter().filter(|weight| **weight == Weight::FULL);
        if full.count() as f64 >= least || limit > WIDEST * tolerance_mm {
            return (limit, weights);
        }
        limit = rounded_up(limit * WIDER);
    }
}

fn count(mask: &[bool]) -> f64 {
    mask.iter().filter(|on| **on).count() as f64
}

/// A limit that is not narrower, in hundredths of a millimetre.
pub(crate) fn rounded_up(mm: f64) -> f64 {
    // A division by 100 prints as hundredths: 0.29, not 0.29000000000000004.
    (mm / STEP_MM).ceil() / (1.0 / STEP_MM).round()
}

impl GoodPartsFile {
    /// What displaced good parts deviate by in squares of `side` pixels; none if it is not known.
    pub fn displaced(&self, side: usize) -> Option<Largest> {
        let known = side == self.smoothing_px && self.displaced_mm > 0.0;
        known.then_some(Largest {
            mean: self.displaced_mm,
            scatter: self.displaced_scatter_mm,
        })
    }

    /// The prediction in words: one line, and further ones if the tolerance is not held everywhere.
    pub fn words(&self) -> Vec<String> {
        let Self {
            tolerance_mm: _,
            limit_mm,
            largest_mm,
            scatter_mm,
            beyond,
            left_out,
            weighed,
            least_weight,
            smoothing_px,
            wider_px,
            wider,
            dent_mm,
            displaced_mm,
            displaced_scatter_mm,
        } = *self;
        if largest_mm == 0.0 {
            return vec![
                "no place of the surface is seen well enough to be compared: more light, less noise or another pose".into(),
            ];
        }
        let expected = format!(
            "good parts deviate by up to {largest_mm:.3} ± {scatter_mm:.3} mm, {} exceeds ±{limit_mm:.2} mm",
            one_in(beyond)
        );
        let mut lines = vec![format!("deviation: {expected}")];
        let elsewhere = match wider_px {
            0 => String::new(),
            side => format!(
                ", over up to {side} × {side} where it is too noisy or too bent for that, {:.1} % of it",
                wider * 100.0
            ),
        };
        let seen = match dent_mm > 0.0 {
            true => format!(
                "a dent of {dent_mm:.1} mm across is seen at nine tenths of its depth, a narrower one at less, which U does not cover"
            ),
            false => "a defect that is narrower is seen at less than its depth".into(),
        };
        lines.push(format!(
            "deviations are means over {smoothing_px} × {smoothing_px} pixels of the part{elsewhere}: {seen}"
        ));
        if displaced_mm > 0.0 {
            lines.push(format!(
                "good parts that lie anywhere within the placement tolerance deviate by less than {:.3} mm",
                displaced_mm + SCATTERS * displaced_scatter_mm
            ));
        }
        if weighed > 0.0 {
            lines.push(format!(
                "{:.2} % of the surface is seen so faintly or flatly that a deviation there must be larger to be found, by a \
                 factor of {:.1} at its worst place: another pose or more light lowers it",
                weighed * 100.0,
                1.0 / least_weight
            ));
        }
        if left_out > 0.0 {
            lines.push(format!(
                "{:.2} % of the surface's pixels are seen too faintly or too flatly for a limit of ±{limit_mm:.2} mm and are not \
                 compared: another pose brings them back",
                left_out * 100.0
            ));
        }
        lines
    }
}

/// "one in 3.0e6".
fn one_in(share: f64) -> String {
    match share > 1e-12 {
        true => format!("one in {:.1e}", 1.0 / share),
        false => "less than one in 1e12".into(),
    }
}
