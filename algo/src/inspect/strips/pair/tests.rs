//! Fits of made-up pairs against theory.

use super::sums::{SIDE, correlated, smoothed};
use super::window::{Band, Windows};
use crate::frame::{FrameView, Samples};
use crate::phase::{LeastModulation, Trust};
use crate::pipeline::PhaseMap;
use crate::simd::Backend;
use crate::units::AbsolutePhase;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec;
use std::vec::Vec;

const WIDTH: usize = 200;
const ROWS: usize = 160;
/// Pixels from the border whose windows are not whole.
const BORDER: usize = SIDE / 2;
const OFFSET: f64 = 105.0;
const MODULATION: f64 = 60.0;

/// What a pair shows.
struct Scene {
    /// Pixels per fringe.
    pitch: f64,
    /// Φ − Φ₀, turns.
    change: f64,
    /// σ of a sample.
    noise: f64,
    bit_depth: u8,
    /// Brightness of a pixel, 0 to 1.
    brightness: fn(usize) -> f64,
}

impl Scene {
    fn expected(&self, at: usize) -> f64 {
        10.0 + (at % WIDTH) as f64 / self.pitch + 0.021 * (at / WIDTH) as f64
    }

    fn frames(&self, seed: u64) -> [Vec<u16>; 2] {
        let mut random = SplitMix64::seed_from_u64(seed);
        let mut uniform = move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        // Twelve uniform numbers: σ = 1.
        let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let scale = f64::from(1_u32 << (self.bit_depth - 8));
        [1.0, -1.0].map(|sign| {
            let sample = |at: usize| {
                let angle = core::f64::consts::TAU * (self.expected(at) + self.change);
                let light = OFFSET + sign * MODULATION * libm::sin(angle);
                let counts = light * (self.brightness)(at) + self.noise * normal();
                libm::rint(counts * scale) as u16
            };
            (0..WIDTH * ROWS).map(sample).collect()
        })
    }

    /// The phases that are measured about the expected ones.
    fn measured(&self, seed: u64, about: &Self, tops: &[usize]) -> PhaseMap {
        self.measured_on(Backend::best().unwrap(), seed, about, tops)
    }

    fn measured_on(&self, backend: Backend, seed: u64, about: &Self, tops: &[usize]) -> PhaseMap {
        let [plus, minus] = self.frames(seed);
        let eight = [&plus, &minus].map(|frame| frame.iter().map(|&s| s as u8).collect::<Vec<_>>());
        let frames = [(&plus, &eight[0]), (&minus, &eight[1])].map(|(sixteen, eight)| {
            let samples = match self.bit_depth {
                8 => Samples::Eight(eight),
                _ => Samples::Sixteen(sixteen),
            };
            FrameView::new(samples, WIDTH, ROWS, WIDTH).unwrap()
        });
        let scale = f64::from(1_u32 << (self.bit_depth - 8));
        let windows = Windows::new(
            backend,
            self.bit_depth,
            self.noise * scale,
            LeastModulation::default(),
        );
        let mut map = PhaseMap::new(WIDTH, ROWS);
        let mut rows = map.rows();
        for (at, &top) in tops.iter().enumerate() {
            let end = tops.get(at + 1).copied().unwrap_or(ROWS);
            let rows = &mut rows[top..end];
            windows.fit(frames, top, rows, &mut Band::default(), |v, out| {
                for (u, phase) in out.phase.iter_mut().enumerate() {
                    *phase = AbsolutePhase::from_turns(about.expected(v * WIDTH + u));
                }
                out.compared.fill(true);
            });
        }
        map
    }

    /// The errors of the inner pixels in turns; all of them must be resolved.
    fn errors(&self, seed: u64) -> Vec<f64> {
        let map = self.measured(seed, self, &[0]);
        let inner = (0..WIDTH * ROWS).filter(|at| {
            let (u, v) = (at % WIDTH, at / WIDTH);
            (BORDER..WIDTH - BORDER).contains(&u) && (BORDER..ROWS - BORDER).contains(&v)
        });
        let error = |at: usize| {
            assert_eq!(map.trust[at], Trust::Resolved, "{at}");
            map.phase[at].turns() - self.expected(at) - self.change
        };
        inner.map(error).collect()
    }
}

const PLAIN: Scene = Scene {
    pitch: 7.3,
    change: 0.13,
    noise: 2.0,
    bit_depth: 8,
    brightness: |_| 1.0,
};

fn rms(values: &[f64]) -> f64 {
    libm::sqrt(values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64)
}

#[test]
fn the_noise_of_a_fitted_phase_is_that_of_theory() {
    let errors: Vec<f64> = (0..4).flat_map(|seed| PLAIN.errors(seed)).collect();
    // Rounding to whole counts adds 1/12.
    let noise = libm::sqrt(PLAIN.noise * PLAIN.noise + 1.0 / 12.0);
    let theory = noise / (core::f64::consts::TAU * MODULATION * SIDE as f64);
    let ratio = rms(&errors) / theory;
    std::println!("σ {:.2e} turn, {ratio:.3} of theory", rms(&errors));
    assert!((0.93..1.07).contains(&ratio), "{ratio}");
}

#[test]
fn means_over_squares_scatter_as_their_shared_pixels_make_them() {
    let columns = WIDTH - 2 * BORDER;
    let noise = libm::sqrt(PLAIN.noise * PLAIN.noise + 1.0 / 12.0);
    let pixel = noise / (core::f64::consts::TAU * MODULATION);
    for side in [1, 3, 9, 21] {
        let mut means = Vec::new();
        for seed in 10..16 {
            let errors = PLAIN.errors(seed);
            for top in (0..ROWS - 2 * BORDER - side).step_by(side) {
                for left in (0..columns - side).step_by(side) {
                    let row = |v: usize| &errors[v * columns + left..][..side];
                    let sum: f64 = (top..top + side).flat_map(row).sum();
                    means.push(sum / (side * side) as f64);
                }
            }
        }
        let predicted = pixel / side as f64 * libm::sqrt(smoothed(side));
        let ratio = rms(&means) / predicted;
        std::println!(
            "squares of {side}: {ratio:.3} of the prediction, {}",
            means.len()
        );
        assert!((0.9..1.1).contains(&ratio), "{side}: {ratio}");
    }
}

#[test]
fn the_share_of_shared_pixels_is_that_of_the_convolution() {
    for side in [1_usize, 2, 6, 7, 8, 31] {
        let mut kernel = vec![0.0; SIDE + side];
        for a in 0..SIDE {
            for b in 0..side {
                kernel[a + b] += 1.0 / (SIDE * side) as f64;
            }
        }
        let along: f64 = kernel.iter().map(|k| k * k).sum::<f64>() * side as f64;
        assert!((smoothed(side) - along * along).abs() < 1e-12, "{side}");
        // Squares that are as large as many windows share next to nothing.
        assert!(correlated(side) > 1.0 && (side < 31 || correlated(side) < 1.01));
    }
}

#[test]
fn the_phase_of_a_pair_has_next_to_no_periodic_error() {
    let mut worst = 0.0_f64;
    for (bit_depth, most) in [(8, 6e-4), (12, 2e-4), (16, 2e-4)] {
        for pitch in [4.1, 5.0, 7.0, 8.3, 11.0, 14.0] {
            for change in [-0.41, -0.2, 0.0, 0.07, 0.33] {
                let scene = Scene {
                    pitch,
                    change,
                    noise: 0.0,
                    bit_depth,
                    ..PLAIN
                };
                let error = rms(&scene.errors(0));
                worst = worst.max(error);
                assert!(
                    error < most,
                    "{bit_depth} bits, {pitch} px, {change}: {error}"
                );
            }
        }
    }
    std::println!("periodic error at most {worst:.1e} turn RMS");
}

#[test]
fn texture_and_oil_change_no_phase() {
    let speckle = |at: usize| 0.4 + 0.6 * (at * 7919 % 101) as f64 / 101.0;
    let oil = |at: usize| if at % WIDTH < WIDTH / 2 { 0.5 } else { 1.0 };
    for brightness in [speckle as fn(usize) -> f64, oil] {
        let scene = Scene {
            brightness,
            noise: 0.0,
            ..PLAIN
        };
        let error = rms(&scene.errors(0));
        assert!(error < 1e-3, "{error}");
    }
}

#[test]
fn another_carrier_than_the_expected_one_is_rejected() {
    let finer = Scene {
        pitch: 5.0,
        ..PLAIN
    };
    let map = finer.measured(3, &PLAIN, &[0]);
    let resolved = map.count(Trust::Resolved) as f64 / map.trust.len() as f64;
    assert!(resolved < 0.01, "{resolved}");
}

#[test]
fn the_bits_depend_neither_on_the_bands_nor_on_the_back_end() {
    let whole = PLAIN.measured(5, &PLAIN, &[0]);
    for tops in [&[0, 3, 5, 64, 159][..], &[0, 80]] {
        assert_eq!(PLAIN.measured(5, &PLAIN, tops), whole);
    }
    for backend in Backend::available() {
        assert_eq!(PLAIN.measured_on(backend, 5, &PLAIN, &[0]), whole);
    }
}
