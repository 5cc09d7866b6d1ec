//! The camera's sensor: light to electrons to counts, with the noise of each step.
//!
//! A pixel collects e = `full_well_e` · light · (1 + p) electrons, where p is its share of the
//! photo-response non-uniformity, the same in all frames. The count is gain · full scale /
//! `full_well_e` · (e + √(e + read²) · z), clipped and rounded: shot noise, read noise and
//! quantisation, σ²(count) = read² + shot · count in counts (J. R. Janesick, *Photon Transfer*,
//! SPIE 2007). With a knee, counts above it are a quarter; a sample may be clipped below full scale. z is the sum of four uniform numbers, whose distribution function differs from the
//! normal one by at most 0.007, and which is never beyond ± 3.47. The paper's sensor has uniform
//! noise instead.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::random::normal;
use super::scenario::{Noise, Scenario};

/// Separates the random numbers of the pixels' responses from those of frames.
const RESPONSES: u64 = 0x5052_4e55;

/// So many pixels are read out at a time.
const BLOCK: usize = 64;

/// What a response loses of the counts above its knee.
const BENT: f32 = 0.75;

/// A sensor, and its random numbers.
pub(super) struct Sensor {
    noise: Noise,
    full_scale: f64,
    /// From where the response is flatter, and where it ends, counts.
    knee: f32,
    most: f32,
    /// 1 + p of each pixel of a frame.
    responses: Vec<f32>,
    seed: u64,
    exposed: u64,
}

impl Sensor {
    pub fn new(scenario: &Scenario) -> Self {
        let (width, height) = scenario.frame_size();
        let noise = scenario.noise;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(noise.seed ^ RESPONSES);
        let response = |_| 1.0 + noise.prnu as f32 * normal(random.next_u64());
        Self {
            full_scale: scenario.full_scale(),
            knee: (scenario.optics.knee_at * scenario.full_scale()) as f32,
            most: (scenario.optics.clips_at * scenario.full_scale()) as f32,
            responses: (0..width * height).map(response).collect(),
            seed: noise.seed,
            exposed: 0,
            noise,
        }
    }

    /// Restarts the noise with another seed. The pixels' responses stay.
    pub fn reseed(&mut self, seed: u64) {
        (self.seed, self.exposed) = (seed, 0);
    }

    /// The next frame's random numbers. The number of the frame is spread over all bits, so that
    /// neighbouring frames and seeds are uncorrelated. Everything else draws from SplitMix64;
    /// Xoshiro256++ stays here because the demonstration's verdicts and many measured figures
    /// depend on these frames.
    pub fn next_frame(&mut self) -> Xoshiro256PlusPlus {
        self.exposed += 1;
        let spread = self.exposed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Xoshiro256PlusPlus::seed_from_u64(self.seed ^ spread.rotate_left(17))
    }

    /// Reads out `light` (of an exposure of normal length, 1 = full scale at gain 1), which was
    /// exposed `longer` times as long, with `gain`. `count` truncates.
    pub fn read<T>(
        &self,
        [longer, gain]: [f64; 2],
        light: &[f32],
        mut random: Xoshiro256PlusPlus,
        samples: &mut [T],
        count: impl Fn(f32) -> T,
    ) {
        let (knee, most) = (self.knee, self.most);
        let bright = (longer * gain * self.full_scale) as f32;
        let bent = |value: f32| value - (value - knee).max(0.0) * BENT;
        let rounded = |value: f32| count(bent(value).clamp(0.0, most) + 0.5);
        let [read, shot] = self
            .noise
            .variance(gain * self.full_scale)
            .map(|v| v as f32);
        let half_width = self
            .noise
            .noise_counts
            .map(|counts| (counts / 255.0 * self.full_scale) as f32);
        // First the random numbers, which come one after the other; the rest is done in lanes.
        let mut words = [0; BLOCK / 2];
        let mut normals = [0.0; BLOCK];
        let pixels = light.chunks(BLOCK).zip(self.responses.chunks(BLOCK));
        for (samples, (light, responses)) in samples.chunks_mut(BLOCK).zip(pixels) {
            if let Some(half_width) = half_width {
                // Half of a random word in −1…1: 2⁻³¹ times a signed half.
                let unit = half_width / 2_147_483_648.0_f32;
                let drawn = &mut words[..samples.len().div_ceil(2)];
                drawn.fill_with(|| random.next_u64());
                let halves = drawn
                    .iter()
                    .flat_map(|word| [*word as u32, (*word >> 32) as u32]);
                for ((sample, light), half) in samples.iter_mut().zip(light).zip(halves) {
                    *sample = rounded(bright * light + (half as i32) as f32 * unit);
                }
            } else {
                let drawn = &mut normals[..samples.len()];
                drawn.fill_with(|| normal(random.next_u64()));
                let pixels = light.iter().zip(responses).zip(drawn);
                for (sample, ((light, response), normal)) in samples.iter_mut().zip(pixels) {
                    let mean = bright * light * response;
                    *sample = rounded(mean + (read + shot * mean).sqrt() * *normal);
                }
            }
        }
    }
}
