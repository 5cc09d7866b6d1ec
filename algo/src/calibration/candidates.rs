//! A grey picture, and the places in it that look like the inner corner of a checkerboard, to a
//! pixel.
//!
//! The picture is the offset of a level's frames in single precision: what the scene looks like
//! under even light, with less noise than one frame.
//!
//! On a ring of 16 samples I₀ … I₁₅ of radius 5 px about a corner, opposite samples are equal, and
//! the samples a quarter of the ring further on are of the other colour. Response R = Σ|(I_n +
//! I_{n+8}) − (I_{n+4} + I_{n+12})| − Σ|I_n − I_{n+8}| − 16·|mean of ring − mean of centre|: large
//! at a corner, and not above 0 at edges and in even areas. Source: S. Bennett, J. Lasenby, "ChESS
//! – quick and robust detection of chess-board features", Computer Vision and Image Understanding
//! 118, 2014. Here it is computed of the picture's logarithm, so that a corner in little light
//! responds as much as a bright one.

use crate::frame::FrameView;
use crate::math::around;
use alloc::vec;
use alloc::vec::Vec;

/// Pixels from the border in which there is no ring.
const MARGIN: usize = 5;
/// Two corners are at least this many pixels apart.
const LEAST_APART: usize = 5;
/// Least response, of logarithms: print of 1 : 1.3 has 16 · ½ · 2 ln 1.3 / 2 ≈ 2 over all of the
/// ring.
const LEAST_RESPONSE: f32 = 1.0;
/// Most candidates: beyond, the weakest are noise.
const MOST_CANDIDATES: usize = 4000;
/// The ring: (u, v), anticlockwise in steps of 22.5°, at radius 5.
const RING: [(i32, i32); 16] = [
    (5, 0),
    (5, 2),
    (4, 4),
    (2, 5),
    (0, 5),
    (-2, 5),
    (-4, 4),
    (-5, 2),
    (-5, 0),
    (-5, -2),
    (-4, -4),
    (-2, -5),
    (0, -5),
    (2, -5),
    (4, -4),
    (5, -2),
];

/// A grey picture.
#[derive(Clone, Debug, PartialEq)]
pub struct GreyPicture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Counts, row-major.
    pub counts: Vec<f32>,
}

impl GreyPicture {
    /// The mean of frames of equal size; over all shifts of one or more levels it is their offset
    /// A.
    pub fn mean(frames: &[FrameView<'_>]) -> Self {
        let (width, height) = frames
            .first()
            .map_or((0, 0), |frame| (frame.width(), frame.height()));
        let mut sums = vec![0_u32; width * height];
        for frame in frames {
            for (v, row) in sums.chunks_mut(width.max(1)).enumerate() {
                frame.row(v).add_to(row);
            }
        }
        let share = 1.0 / frames.len().max(1) as f32;
        Self {
            width,
            height,
            counts: sums.into_iter().map(|sum| sum as f32 * share).collect(),
        }
    }

    /// The sample at column u and row v.
    #[inline]
    pub fn at(&self, u: usize, v: usize) -> f32 {
        self.counts[v * self.width + u]
    }

    /// The picture at half the size: means of 2 × 2 pixels. Pixel (u, v) of it lies at (2u + ½,
    /// 2v + ½) of this one.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (2 * u, 2 * v)));
        Self {
            width,
            height,
            counts: pixels
                .map(|(u, v)| {
                    let above = self.at(u, v) + self.at(u + 1, v);
                    let below = self.at(u, v + 1) + self.at(u + 1, v + 1);
                    0.25 * (above + below)
                })
                .collect(),
        }
    }

    /// The logarithm of the picture, smoothed with the binomial kernel 1 4 6 4 1: even light or
    /// not, an edge between two albedos has the same height. `floor` counts are added, so that
    /// noise in the dark stays small.
    #[must_use]
    pub(super) fn levelled(&self, floor: f32) -> Self {
        let logarithm = |&counts: &f32| libm::logf(counts.max(0.0) + floor);
        let logs = Self {
            counts: self.counts.iter().map(logarithm).collect(),
            ..*self
        };
        logs.smoothed(1, 0).smoothed(0, 1)
    }

    /// Smoothed along one axis; the border's pixels are repeated outside.
    fn smoothed(&self, du: usize, dv: usize) -> Self {
        const KERNEL: [f32; 5] = [1.0 / 16.0, 0.25, 0.375, 0.25, 1.0 / 16.0];
        let (right, bottom) = (self.width.saturating_sub(1), self.height.saturating_sub(1));
        let pixels = (0..self.height).flat_map(|v| (0..self.width).map(move |u| (u, v)));
        let sum = |(u, v): (usize, usize)| {
            let samples = KERNEL.iter().enumerate().map(|(at, weight)| {
                let column = (u + at * du).saturating_sub(2 * du).min(right);
                let row = (v + at * dv).saturating_sub(2 * dv).min(bottom);
                weight * self.at(column, row)
            });
            samples.sum()
        };
        Self {
            counts: pixels.map(sum).collect(),
            ..*self
        }
    }
}

/// A place that looks like a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    pub u: f64,
    pub v: f64,
    /// The response.
    pub strength: f32,
    /// Second harmonic Σ I_n e^{−2iθ_n} of the ring: its half angle points into a bright square.
    pub harmonic: (f64, f64),
}

impl Candidate {
    /// Cosine of the angle between the harmonics of two candidates: 1 for the same colours, −1 with
    /// black and white exchanged.
    pub fn alike(&self, other: &Self) -> f64 {
        let ((a, b), (c, d)) = (self.harmonic, other.harmonic);
        let lengths = libm::hypot(a, b) * libm::hypot(c, d);
        (a * c + b * d) / lengths.max(f64::MIN_POSITIVE)
    }
}

/// The candidates of a levelled picture, the strongest first.
pub(super) fn candidates(picture: &GreyPicture) -> Vec<Candidate> {
    let (width, height) = (picture.width, picture.height);
    if width <= 2 * MARGIN || height <= 2 * MARGIN {
        return Vec::new();
    }
    let mut responses = GreyPicture {
        counts: vec![0.0; width * height],
        ..*picture
    };
    for v in MARGIN..height - MARGIN {
        for u in MARGIN..width - MARGIN {
            responses.counts[v * width + u] = response(picture, u, v);
        }
    }
    let mut found = Vec::new();
    for v in MARGIN..height - MARGIN {
        for u in MARGIN..width - MARGIN {
            let strength = responses.at(u, v);
            if strength >= LEAST_RESPONSE && largest(&responses, u, v) {
                found.push(Candidate {
                    u: u as f64,
                    v: v as f64,
                    strength,
                    harmonic: harmonic(&ring(picture, u, v)),
                });
            }
        }
    }
    found.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    found.truncate(MOST_CANDIDATES);
    found
}

#[inline]
fn ring(picture: &GreyPicture, u: usize, v: usize) -> [f32; 16] {
    // The margin keeps every sample inside the picture.
    let centre = (v * picture.width + u) as isize;
    RING.map(|(du, dv)| {
        picture.counts[(centre + dv as isize * picture.width as isize + du as isize) as usize]
    })
}

fn response(picture: &GreyPicture, u: usize, v: usize) -> f32 {
    let ring = ring(picture, u, v);
    let mut sum = 0.0;
    for n in 0..4 {
        sum += (ring[n] + ring[n + 8] - ring[n + 4] - ring[n + 12]).abs();
    }
    let mut difference = 0.0;
    for n in 0..8 {
        difference += (ring[n] - ring[n + 8]).abs();
    }
    let centre = picture.at(u, v)
        + picture.at(u - 1, v)
        + picture.at(u + 1, v)
        + picture.at(u, v - 1)
        + picture.at(u, v + 1);
    let mean = ring.iter().sum::<f32>() / 16.0;
    sum - difference - 16.0 * (mean - centre / 5.0).abs()
}

/// Whether no response nearby is larger, and none before this place, row by row, is equal.
fn largest(responses: &GreyPicture, u: usize, v: usize) -> bool {
    let strength = responses.at(u, v);
    around(v, LEAST_APART, responses.height).all(|row| {
        around(u, LEAST_APART, responses.width).all(|column| {
            let other = responses.at(column, row);
            other < strength || (other == strength && (row, column) >= (v, u))
        })
    })
}

fn harmonic(ring: &[f32; 16]) -> (f64, f64) {
    let mut sum = (0.0, 0.0);
    for (&(du, dv), &sample) in RING.iter().zip(ring) {
        let (x, y) = (f64::from(du), f64::from(dv));
        let (r2, sample) = (x * x + y * y, f64::from(sample));
        // cos 2θ = (x² − y²)/r², sin 2θ = 2xy/r².
        sum.0 += sample * (x * x - y * y) / r2;
        sum.1 += sample * 2.0 * x * y / r2;
    }
    sum
}
