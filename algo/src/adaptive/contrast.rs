//! Contrast of fringes after the optics of projector and camera, and what the projector's pixels
//! add to them.
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

use core::f64::consts::PI;

/// How contrast falls with frequency, and the limits of pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
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
    let at = |f: f64| {
        let across = f * slope;
        let camera = (1.0 / (PI * across)).min(1.0) * gauss(blur.camera, across);
        libm::fabs(sinc(f)) * gauss(blur.projector, f) * camera
    };
    at(1.0 - g) + at(1.0 + g)
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
