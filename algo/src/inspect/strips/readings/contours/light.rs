//! The demodulated light of pixels: from the frames of a part, or from golden's signal.

use crate::frame::{FrameView, Samples};
use crate::math::complex::Complex;
use crate::pattern::Sequence;
use crate::pipeline::CLIPPED;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Steps of golden's signal per count of an 8-bit sample.
const STEPS: f64 = 64.0;
/// Counts of an 8-bit sample at full scale.
const EIGHT_BIT: f64 = 255.0;

/// What the light of a part is known from.
#[derive(Clone, Copy, Debug)]
pub enum Signal<'a> {
    /// All frames of its sequence, and σ of what changes of light left in a sample, over that of
    /// noise.
    Frames(&'a [FrameView<'a>], f64),
    /// Golden's signal: the part is golden.
    Golden,
    /// Not known: contours are not seen.
    None,
}

impl Signal<'_> {
    /// σ of what changes of light left in a sample, over that of noise.
    pub fn unsteady(self) -> f64 {
        match self {
            Self::Frames(_, unsteady) => unsteady,
            Self::Golden | Self::None => 0.0,
        }
    }
}

/// Golden's signal: Z = B e^{2πiφ} of each pixel of the finest level of the full sequence.
#[derive(Clone, Debug)]
pub struct GoldenSignal {
    /// Real and imaginary part of each pixel, row-major, in 1/64 count of an 8-bit sample.
    pub values: Arc<[i16]>,
    /// r of its level.
    pub ratio: f64,
    /// N, the number of its shifts.
    pub shifts: usize,
    /// The modulation by this sequence over that of the signal.
    pub brighter: f64,
    /// Whether a contour is looked for of which golden shows too little: an editor shows what is
    /// seen of it.
    pub lenient: bool,
}

impl GoldenSignal {
    /// Z of a pixel, in counts of samples that are `full_scale` at most; none where it is not known.
    pub fn at(&self, place: usize, full_scale: f64) -> Option<Complex> {
        let &[re, im] = self.values.get(2 * place..2 * place + 2)? else {
            return None;
        };
        if re == CLIPPED {
            return None;
        }
        let unit = full_scale / EIGHT_BIT / STEPS;
        Some(Complex::new(f64::from(re) * unit, f64::from(im) * unit))
    }
}

/// How the levels of a sequence are demodulated.
#[derive(Clone, Debug)]
pub struct Levels {
    all: Vec<LevelDemodulation>,
    full_scale: f64,
}

/// A level: its ratio, and the place and the weights of each of its frames.
#[derive(Clone, Debug)]
struct LevelDemodulation {
    ratio: f64,
    frames: Vec<(usize, Complex)>,
}

impl Levels {
    /// Of a sequence, whose samples are `full_scale` at most.
    pub fn new(sequence: &Sequence, full_scale: u16) -> Self {
        let all = sequence.levels().iter().map(|level| {
            let count = level.shifts() as f64;
            let frames = level.frames.iter().enumerate().map(|(k, &frame)| {
                let angle = TAU * (level.start + k as f64 / count);
                let weight = Complex::new(
                    2.0 / count * libm::sin(angle),
                    2.0 / count * libm::cos(angle),
                );
                (usize::from(frame), weight)
            });
            LevelDemodulation {
                ratio: level.ratio,
                frames: frames.collect(),
            }
        });
        Self {
            all: all.collect(),
            full_scale: f64::from(full_scale),
        }
    }

    /// The largest sample.
    pub fn full_scale(&self) -> f64 {
        self.full_scale
    }

    /// Whether all levels have quadrature: two shifts have none.
    pub fn demodulate(&self) -> bool {
        self.all.iter().all(|level| level.frames.len() > 2)
    }

    /// Ratio and number of shifts of each level.
    pub fn fringes(&self) -> impl Iterator<Item = (f64, usize)> + '_ {
        self.all
            .iter()
            .map(|level| (level.ratio, level.frames.len()))
    }

    /// Z = (2/N) Σ I_k (sin 2πs_k + i cos 2πs_k) of a level at the pixels of a row that begin with
    /// (u, v); [`Complex::UNKNOWN`] where a sample is overexposed, or a frame is missing.
    pub fn signals(
        &self,
        frames: &[FrameView<'_>],
        level: usize,
        (u, v): (usize, usize),
        row: &mut [Complex],
    ) {
        let Some(level) = self.all.get(level) else {
            row.fill(Complex::UNKNOWN);
            return;
        };
        row.fill(Complex::default());
        let places = u..u + row.len();
        for &(frame, weight) in &level.frames {
            match frames.get(frame).map(|frame| frame.row(v)) {
                Some(Samples::Eight(all)) => self.add(all.get(places.clone()), weight, row),
                Some(Samples::Sixteen(all)) => self.add(all.get(places.clone()), weight, row),
                None => row.fill(Complex::UNKNOWN),
            }
        }
    }

    /// Adds the samples of one frame.
    fn add<T: Copy + Into<f64>>(
        &self,
        samples: Option<&[T]>,
        weight: Complex,
        row: &mut [Complex],
    ) {
        let Some(samples) = samples else {
            row.fill(Complex::UNKNOWN);
            return;
        };
        for (sum, sample) in row.iter_mut().zip(samples) {
            let sample: f64 = (*sample).into();
            if sample >= self.full_scale {
                *sum = Complex::UNKNOWN;
            }
            sum.re += weight.re * sample;
            sum.im += weight.im * sample;
        }
    }
}
