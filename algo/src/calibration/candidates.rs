//! Places that look like the inner corner of a checkerboard, to a pixel.
//!
//! On a ring of 16 samples I₀ … I₁₅ of radius 5 px about a corner, opposite samples are equal, and
//! the samples a quarter of the ring further on are of the other colour. Response R = Σ|(I_n +
//! I_{n+8}) − (I_{n+4} + I_{n+12})| − Σ|I_n − I_{n+8}| − 16·|mean of ring − mean of centre|: large
//! at a corner, and not above 0 at edges and in even areas. Source: S. Bennett, J. Lasenby, "ChESS
//! – quick and robust detection of chess-board features", Computer Vision and Image Understanding
//! 118, 2014. Here it is computed of the picture's logarithm, so that a corner in little light
//! responds as much as a bright one.

use super::picture::Picture;
use alloc::vec::Vec;

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
/// Pixels from the border in which there is no ring.
const MARGIN: usize = 5;
/// Two corners are at least this many pixels apart.
const APART: usize = 5;
/// Least response, of logarithms: print of 1 : 1.3 has 16 · ½ · 2 ln 1.3 / 2 ≈ 2 over all of the
/// ring.
const LEAST: f32 = 1.0;
/// Most candidates: beyond, the weakest are noise.
const MOST: usize = 4000;

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
pub(super) fn candidates(picture: &Picture) -> Vec<Candidate> {
    let (width, height) = (picture.width, picture.height);
    if width <= 2 * MARGIN || height <= 2 * MARGIN {
        return Vec::new();
    }
    let mut responses = Picture {
        counts: alloc::vec![0.0; width * height],
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
            let here = responses.at(u, v);
            if here >= LEAST && largest(&responses, u, v) {
                found.push(Candidate {
                    u: u as f64,
                    v: v as f64,
                    strength: here,
                    harmonic: harmonic(&ring(picture, u, v)),
                });
            }
        }
    }
    found.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    found.truncate(MOST);
    found
}

#[inline]
fn ring(picture: &Picture, u: usize, v: usize) -> [f32; 16] {
    // The margin keeps every sample inside the picture.
    let at = (v * picture.width + u) as isize;
    RING.map(|(du, dv)| {
        picture.counts[(at + dv as isize * picture.width as isize + du as isize) as usize]
    })
}

fn response(picture: &Picture, u: usize, v: usize) -> f32 {
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
fn largest(responses: &Picture, u: usize, v: usize) -> bool {
    let here = responses.at(u, v);
    let rows = v.saturating_sub(APART)..(v + APART + 1).min(responses.height);
    rows.into_iter().all(|row| {
        let columns = u.saturating_sub(APART)..(u + APART + 1).min(responses.width);
        columns.into_iter().all(|column| {
            let there = responses.at(column, row);
            there < here || (there == here && (row, column) >= (v, u))
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
