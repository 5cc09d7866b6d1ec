//! Contrast of fringes after the optics of projector and camera, what the projector's pixels add to
//! them, and the blur of both lenses, found from the contrast on a part and on a plate.
//!
//! # Contrast
//!
//! A projector pixel is a bright square, which its lens blurs; a camera pixel integrates over a
//! square of its own, and its lens blurs as well. So a sine of g turns per projector pixel, which
//! the camera sees with the gradient (a, b) turns per camera pixel, has the contrast
//!
//! ```text
//! M(g) = sinc g · exp(−2π²σ_P²g²) · sinc a · sinc b · exp(−2π²σ_C²(a² + b²))        sinc x = sin πx / πx
//! ```
//!
//! The squares also show the sine at the frequencies 1 − g and 1 + g ([`replicas`]).
//!
//! # Blur
//!
//! **Idea.** The projector's blur weakens fringes by their pitch in projector pixels, the camera's
//! by their pitch in camera pixels. On steep surfaces these differ, so a part with slopes tells
//! both apart.
//!
//! **Equation.** Of two frequencies f and c on a surface of slope J, the contrast beyond that of
//! the pixels' squares falls by exp(−2π²(f² − c²)(σ_P² + |J|²σ_C²)): the logarithm is a straight
//! line over |J|². Its two numbers are a least-squares fit through the medians of [`GROUPS`] groups
//! of pixels of about the same slope, because medians ignore edges and noise. What calibration
//! measured on a plate counts as much as all groups together. Where all slopes are alike, the blur
//! is put on the projector.

use alloc::vec::Vec;
use core::f64::consts::PI;

/// Groups of pixels whose medians are fitted.
const GROUPS: usize = 16;
/// Below this variance of |J|², as a share of its mean square, all slopes are alike.
const ALIKE: f64 = 0.05;

/// How contrast falls with frequency, and the limits of pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FringeOptics {
    /// The blur of both lenses.
    pub blur: Blur,
    /// Smallest pitch in projector pixels.
    pub projector_pitch: f64,
    /// Smallest pitch in camera pixels.
    pub image_pitch: f64,
}

/// Gaussian blur of both lenses, beside the squares of the pixels themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Blur {
    /// σ of the projector's lens, projector pixels.
    pub projector: f64,
    /// σ of the camera's lens, camera pixels.
    pub camera: f64,
}

/// The contrast M of a sine of frequency `g` (turns per projector pixel) that the camera sees with
/// gradient `[a, b]` (turns per camera pixel along u and v).
pub fn contrast(blur: &Blur, g: f64, [a, b]: [f64; 2]) -> f64 {
    let camera = sinc(a) * sinc(b) * gauss(blur.camera, libm::sqrt(a * a + b * b));
    sinc(g) * gauss(blur.projector, g) * camera
}

/// The light, as a share of the raster's sine, that the projector's squares show at 1 − g and 1 + g
/// turns per pixel, where the camera sees the slope `[ju, jv]` (projector pixels per camera pixel).
///
/// Shifting the sine shifts these replicas in step, so demodulation takes them for the sine: the
/// phase is off by up to this share of the contrast, in radian, once per projector pixel. For the
/// camera's square the envelope 1/πx is taken instead of |sinc x|, because where the square is
/// blind depends on more than the slope.
pub fn replicas(blur: &Blur, g: f64, [ju, jv]: [f64; 2]) -> f64 {
    let slope = libm::sqrt(ju * ju + jv * jv);
    let replica = |f: f64| {
        let across = f * slope;
        let camera = (1.0 / (PI * across)).min(1.0) * gauss(blur.camera, across);
        libm::fabs(sinc(f)) * gauss(blur.projector, f) * camera
    };
    replica(1.0 - g) + replica(1.0 + g)
}

/// The Fourier transform of a Gaussian of this σ.
fn gauss(sigma: f64, f: f64) -> f64 {
    libm::exp(-2.0 * (PI * sigma * f) * (PI * sigma * f))
}

/// sin πx / πx.
fn sinc(x: f64) -> f64 {
    let angle = PI * x;
    if libm::fabs(angle) < 1e-9 {
        1.0
    } else {
        libm::sin(angle) / angle
    }
}

/// σ_P² + |J|²σ_C² of a surface with slope J, as a point of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// |J|², squared projector pixels per squared camera pixel.
    pub steepness: f64,
    /// The variance of the blur, squared projector pixels.
    pub variance: f64,
}

impl Spread {
    /// The point of the modulation at `fine` as a share of that at `coarse` (turns per projector
    /// pixel) on a surface of slope `[ju, jv]`. `None` if no number follows, for example
    /// because one of them is unknown.
    pub fn new([ju, jv]: [f64; 2], share: f64, [fine, coarse]: [f64; 2]) -> Option<Self> {
        let pixels = |g: f64| contrast(&Blur::default(), g, [g * ju, g * jv]);
        let lost = -libm::log(share * pixels(coarse) / pixels(fine));
        let variance = lost / (2.0 * PI * PI * (fine * fine - coarse * coarse));
        let steepness = ju * ju + jv * jv;
        (variance.is_finite() && steepness.is_finite()).then_some(Self {
            steepness,
            variance,
        })
    }
}

impl Blur {
    /// The blur of both lenses from the pixels of a part, and from a plate, if one was measured.
    /// `None` if there are neither pixels nor a plate.
    pub fn fit(mut part: Vec<Spread>, plate: Option<Spread>) -> Option<Self> {
        part.sort_unstable_by(|a, b| a.steepness.total_cmp(&b.steepness));
        let size = part.len().div_ceil(GROUPS).max(1);
        let groups: Vec<Spread> = part.chunks_mut(size).map(middle).collect();
        let weight = groups.len().max(1) as f64;
        let points = groups.iter().map(|group| (1.0, *group));
        let points = points.chain(plate.map(|plate| (weight, plate)));
        let [mut n, mut x, mut y, mut xx, mut xy] = [0.0; 5];
        for (weight, point) in points {
            let (steepness, variance) = (point.steepness, point.variance);
            n += weight;
            x += weight * steepness;
            y += weight * variance;
            xx += weight * steepness * steepness;
            xy += weight * steepness * variance;
        }
        if n == 0.0 {
            return None;
        }
        let spread = n * xx - x * x;
        let camera = match spread > ALIKE * n * xx {
            // Neither variance is below 0.
            true => ((n * xy - x * y) / spread).clamp(0.0, (xy / xx).max(0.0)),
            false => 0.0,
        };
        Some(Self {
            projector: libm::sqrt(((y - camera * x) / n).max(0.0)),
            camera: libm::sqrt(camera),
        })
    }
}

/// The medians of a group, which is sorted by steepness and not empty.
fn middle(group: &mut [Spread]) -> Spread {
    let middle = group.len() / 2;
    let steepness = group[middle].steepness;
    let (_, median, _) =
        group.select_nth_unstable_by(middle, |a, b| a.variance.total_cmp(&b.variance));
    Spread {
        steepness,
        variance: median.variance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREQUENCIES: [f64; 2] = [1.0 / 20.0, 1.0 / 900.0];

    /// What a surface of slope `j` shows of a blur.
    fn seen(blur: &Blur, j: f64, [fine, coarse]: [f64; 2]) -> Spread {
        let at = |g: f64| contrast(blur, g, [g * j, 0.1 * g]);
        Spread::new([j, 0.1], at(fine) / at(coarse), [fine, coarse]).unwrap()
    }

    #[test]
    fn a_part_with_slopes_tells_the_blur_of_both_lenses_apart() {
        let blur = Blur {
            projector: 1.0,
            camera: 0.5,
        };
        let slopes = (0..999).map(|i| 0.5 + 0.003 * f64::from(i));
        let mut part: Vec<Spread> = slopes.map(|j| seen(&blur, j, FREQUENCIES)).collect();
        // One pixel in nine lies at an edge.
        for at in part.iter_mut().step_by(9) {
            at.variance *= 3.0;
        }
        let plate = seen(&blur, 0.9, [1.0 / 8.0, 1.0 / 64.0]);
        for found in [Blur::fit(part.clone(), Some(plate)), Blur::fit(part, None)] {
            let found = found.unwrap();
            assert!((found.projector - 1.0).abs() < 0.03, "{found:?}");
            assert!((found.camera - 0.5).abs() < 0.03, "{found:?}");
        }
    }

    #[test]
    fn a_flat_part_puts_all_blur_on_the_projector() {
        let blur = Blur {
            projector: 0.6,
            camera: 0.5,
        };
        let part = [0.99, 1.0, 1.01].map(|j| seen(&blur, j, FREQUENCIES));
        let found = Blur::fit(part.into(), None).unwrap();
        assert_eq!(found.camera, 0.0);
        assert!((found.projector - 0.781).abs() < 0.005, "{found:?}");
    }

    #[test]
    fn contrast_above_that_of_the_pixels_is_no_blur_and_nothing_measured_is_none() {
        let sharper = Spread {
            steepness: 1.0,
            variance: -0.1,
        };
        assert_eq!(Blur::fit([sharper].into(), None), Some(Blur::default()));
        assert_eq!(Blur::fit(Vec::new(), None), None);
        assert_eq!(Spread::new([1.0, 0.0], f64::NAN, FREQUENCIES), None);
        assert_eq!(Spread::new([1.0, 0.0], 0.0, FREQUENCIES), None);
    }
}
