//! Frames of an uneven part, computed with integers only, so that they are the same on every
//! machine.

use super::Outcome;
use super::cases::{Case, FRINGES};
use algo::frame::{FrameView, Samples};
use algo::units::AbsolutePhase;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Samples between the end of a row and the next.
const PADDING: usize = 3;
/// Half width of the noise as full scale / n: n of [`Lighting::Everything`], and of the others.
const NOISE: (i64, i64) = (60, 250);
/// Phase rise of the part, 1/65536 turn: less than half a turn, so that one level about a map is
/// enough.
const RISE: i64 = 20_000;

/// How the scene is lit.
#[derive(Clone, Copy, PartialEq)]
pub enum Lighting {
    /// Every pixel is resolved.
    Even,
    /// The same in the first quarter of the columns; the others are dark.
    Background,
    /// Every reason to reject a pixel: four sixths of the rows have dark, saturated and weak
    /// patches, one sixth is noise alone, and one has samples at the ends of the scale and
    /// modulations about the threshold.
    Everything,
}

/// Bytes of which the address of a frame is a multiple, if it is aligned: a page of a Raspberry
/// Pi 5.
const PAGE: usize = 16 << 10;
/// Bytes of which the length of a row is a multiple, if the frame is aligned: a line of the cache.
const LINE: usize = 64;

/// The frames of one case, and the map for cases that are unwrapped about one.
pub struct Image {
    eight: Vec<Frame<u8>>,
    sixteen: Vec<Frame<u16>>,
    map: Vec<AbsolutePhase>,
    width: usize,
}

/// The samples of a frame from `start` on, in rows that are `stride` apart.
struct Frame<T> {
    samples: Vec<T>,
    start: usize,
    stride: usize,
}

impl<T: Copy + Default> Frame<T> {
    fn padded(samples: Vec<T>, width: usize) -> Self {
        Self {
            samples,
            start: 0,
            stride: width + PADDING,
        }
    }

    fn used(&self) -> &[T] {
        &self.samples[self.start..]
    }

    /// The same rows as a camera delivers them: from a page on, each from a line of the cache on.
    fn aligned(&self) -> Self {
        let stride = self.stride.next_multiple_of(LINE / size_of::<T>());
        let rows = self.used().chunks(self.stride);
        let mut samples = vec![T::default(); PAGE / size_of::<T>() + rows.len() * stride];
        let start = samples.as_ptr().align_offset(PAGE);
        for (to, from) in samples[start..].chunks_mut(stride).zip(rows) {
            to[..from.len()].copy_from_slice(from);
        }
        Self {
            samples,
            start,
            stride,
        }
    }
}

impl Image {
    /// Exposes `width` × `height` pixels.
    pub fn new(case: &Case, light: Lighting, width: usize, height: usize) -> Self {
        let scene = Scene {
            full: (1 << case.bits) - 1,
            light,
            width,
            height,
        };
        // The frozen hashes depend on this generator and its seed.
        let mut random =
            SplitMix64::seed_from_u64(u64::from(case.bits) << 8 | case.levels[0].1 as u64);
        let frames = case.frames().map(|(ratio, k, shifts)| {
            let mut samples = vec![0; (width + PADDING) * height];
            for (v, row) in samples.chunks_mut(width + PADDING).enumerate() {
                for (u, sample) in row.iter_mut().enumerate() {
                    let turn = scene.turn(u, v, ratio) + (65_536 * k / shifts) as i64;
                    *sample = scene.sample(u, v, turn as u16, ratio == 1.0, &mut random);
                }
            }
            samples
        });
        let frames: Vec<Vec<u16>> = frames.collect();
        let byte = |frame: &Vec<u16>| {
            let bytes = frame.iter().map(|&sample| sample as u8).collect();
            Frame::padded(bytes, width)
        };
        let map = (0..width * height).map(|at| scene.known(at % width));
        Self {
            eight: if case.bits == 8 {
                frames.iter().map(byte).collect()
            } else {
                Vec::new()
            },
            map: map.collect(),
            sixteen: frames
                .into_iter()
                .map(|frame| Frame::padded(frame, width))
                .collect(),
            width,
        }
    }

    /// The same frames as a camera delivers them: each begins at a page of 16 KiB.
    pub fn aligned(&self) -> Self {
        Self {
            eight: self.eight.iter().map(Frame::aligned).collect(),
            sixteen: self.sixteen.iter().map(Frame::aligned).collect(),
            map: self.map.clone(),
            width: self.width,
        }
    }

    /// The first `rows` rows.
    pub fn frames(&self, rows: usize) -> Outcome<Vec<FrameView<'_>>> {
        let view = |samples, stride| FrameView::new(samples, self.width, rows, stride);
        let views: Result<Vec<_>, _> = if self.eight.is_empty() {
            let frames = self.sixteen.iter();
            frames
                .map(|frame| view(Samples::Sixteen(frame.used()), frame.stride))
                .collect()
        } else {
            let frames = self.eight.iter();
            frames
                .map(|frame| view(Samples::Eight(frame.used()), frame.stride))
                .collect()
        };
        Ok(views?)
    }

    /// The map, where the case needs one.
    pub fn map(&self, case: &Case) -> Option<&[AbsolutePhase]> {
        case.needs_map().then_some(&self.map[..])
    }
}

struct Scene {
    full: i64,
    light: Lighting,
    width: usize,
    height: usize,
}

impl Scene {
    /// Φ of the plane, 1/65536 turn: from the first fringe to the last but one.
    fn plane(&self, u: usize) -> i64 {
        65_536 + (FRINGES - 2) * 65_536 * u as i64 / self.width as i64
    }

    /// Φ₀ of the map; with [`Lighting::Everything`] some columns are unknown.
    fn known(&self, u: usize) -> AbsolutePhase {
        if self.light == Lighting::Everything && u % 16 == 7 {
            return AbsolutePhase::UNKNOWN;
        }
        AbsolutePhase::from_bits((self.plane(u) + RISE / 2) as i32)
    }

    /// The phase of a level, 1/65536 turn: the part is an arch over the rows.
    fn turn(&self, u: usize, v: usize, ratio: f64) -> i64 {
        let (v, height) = (v as i64, self.height as i64);
        let phase = self.plane(u) + 4 * RISE * v * (height - v) / (height * height);
        // Multiplying by a power of two is exact.
        (phase * (ratio * f64::from(1 << 30)) as i64) >> 30
    }

    fn sample(&self, u: usize, v: usize, turn: u16, finest: bool, random: &mut SplitMix64) -> u16 {
        let draw = random.next_u64();
        let band = if self.light == Lighting::Everything {
            6 * v / self.height
        } else {
            0
        };
        let full = self.full;
        let below = |end: i64| (draw % (end as u64)) as i64;
        let sample = match band {
            4 => below(full + 1),
            5 if u % 8 < 4 => [0, 1, full / 2, full - 1, full][below(5) as usize],
            // With samples two of these increments apart, a level of 4 shifts is exactly at the
            // threshold.
            5 => full / 2 + 16 * full / 255 * below(3),
            _ => {
                // Offset and modulation, 1/256 of full scale.
                let patch = (u / 8 * 5 + v / 8 * 3) % 16;
                let (offset, modulation) = match (self.light, patch) {
                    (Lighting::Background, _) if 4 * u >= self.width => (12, 4),
                    (Lighting::Even | Lighting::Background, _) => (120, 90),
                    (_, 0) => (12, 4),
                    (_, 1) => (170, 95),
                    (_, 2) if finest => (90, 3),
                    // Modulations about the threshold of 16 of 255 counts.
                    (_, 3) => (60, 14 + (u % 8) as i64 / 2),
                    (_, patch) => (110, 30 + 5 * patch as i64),
                };
                let light = (offset << 15) + modulation * sine(turn);
                let noise = match self.light {
                    Lighting::Everything => full / NOISE.0,
                    Lighting::Even | Lighting::Background => full / NOISE.1,
                };
                let noise = below(2 * noise + 1) - noise;
                ((full * light) >> 23) + noise
            }
        };
        sample.clamp(0, full) as u16
    }
}

/// Sine of 1/65536 turns in Q15, within 0.2 %: a parabola, corrected by its own square.
fn sine(turn: u16) -> i64 {
    let x = i64::from(turn as i16);
    let y = (4 * x * (32_768 - x.abs())) >> 15;
    y + ((29 * (((y * y.abs()) >> 15) - y)) >> 7)
}
