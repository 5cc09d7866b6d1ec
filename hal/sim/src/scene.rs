//! The frames of the simulated camera, from the rasters in view: light, blur, noise and counts.
//!
//! Measured in release on one core for 512 × 512 pixels: about 3 ms per frame including noise (the test
//! `speed_of_building_a_transport_and_of_one_frame` prints it).

use std::sync::Arc;

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use super::blur;
use super::scenario::Scenario;
use super::spread;
use super::stage::Staged;
use super::transport::PADDING;
use hal::error::Error;
use hal::frame::{Frame, FrameFormat, Pixels, Pool};
use hal::projector::Raster;
use hal::units::Timestamp;
use hal::virtual_head::Scene;

/// How many frames may be kept before each further one costs an allocation.
const MAX_KEPT_FRAMES: usize = 64;

/// Part, rasters and sensor of a simulated head.
pub(crate) struct SimScene {
    scenario: Arc<Scenario>,
    placed: Staged,
    /// The light of each loaded raster, 1 = white, row by row, with [`PADDING`].
    rasters: Vec<Vec<f32>>,
    /// The light on the camera; the memory is reused for each frame.
    picture: Vec<f32>,
    /// The light on the camera of one pattern, where several were in view.
    part: Vec<f32>,
    pool: Pool,
    seed: u64,
    exposed: u64,
    /// Factor on all light: the gain, and the exposure relative to the scenario's.
    brightness: f64,
}

impl SimScene {
    pub(super) fn new(scenario: Arc<Scenario>, placed: Staged) -> Self {
        let camera = &scenario.rig.camera;
        let sensor = camera.width as usize * camera.height as usize;
        let (width, height) = scenario.frame_size();
        let format = FrameFormat::packed(width, height, scenario.bit_depth);
        Self {
            placed,
            rasters: Vec::new(),
            picture: vec![0.0; sensor],
            part: vec![0.0; sensor],
            pool: Pool::new(format, MAX_KEPT_FRAMES),
            seed: scenario.noise.seed,
            exposed: 0,
            brightness: scenario.optics.gain,
            scenario,
        }
    }

    /// Puts another part in place.
    pub(super) fn place(&mut self, placed: Staged) {
        self.placed = placed;
    }

    /// The part in place.
    pub(super) fn placed(&self) -> Staged {
        self.placed.clone()
    }

    /// Sets the factor on all light.
    pub(super) fn set_brightness(&mut self, brightness: f64) {
        self.brightness = brightness;
    }

    /// Restarts the noise with another seed.
    pub(super) fn reseed(&mut self, seed: u64) {
        self.seed = seed;
        self.exposed = 0;
    }
}

impl Scene for SimScene {
    fn format(&self) -> FrameFormat {
        let (width, height) = self.scenario.frame_size();
        FrameFormat::packed(width, height, self.scenario.bit_depth)
    }

    fn encoding(&self) -> &'static str {
        match self.scenario.colour {
            true => "one green plane of RGGB, with half its columns and rows",
            false => "RAW",
        }
    }

    fn projector_size(&self) -> (u32, u32) {
        (
            self.scenario.rig.projector.width,
            self.scenario.rig.projector.height,
        )
    }

    fn load(&mut self, rasters: Vec<Raster>) -> Result<(), Error> {
        let optics = &self.scenario.optics;
        let response: Vec<f32> = (0..256_u32)
            .map(|grey| (f64::from(grey) / 255.0).powf(optics.gamma) as f32)
            .collect();
        let light = |raster: Raster| {
            let mut light: Vec<f32> = raster
                .pixels()
                .iter()
                .map(|grey| response[usize::from(*grey)])
                .collect();
            blur::gaussian(
                &mut light,
                raster.width() as usize,
                spread::split(optics.projector_blur_px).1,
            );
            adapt(&mut light, optics.content_gain);
            light.resize(light.len() + PADDING, 0.0);
            light
        };
        self.rasters = rasters.into_iter().map(light).collect();
        Ok(())
    }

    fn loaded(&self) -> usize {
        self.rasters.len()
    }

    fn expose(
        &mut self,
        seen: &[(Option<usize>, f32)],
        timestamp: Timestamp,
        count: u64,
    ) -> Result<Frame, Error> {
        let raster = |shown: Option<usize>| {
            let raster = shown.and_then(|index| self.rasters.get(index));
            raster.map(Vec::as_slice)
        };
        let transport = &self.placed.transport;
        match seen {
            [(shown, share)] => {
                transport.light(raster(*shown), &mut self.picture);
                self.picture.iter_mut().for_each(|light| *light *= share);
            }
            several => {
                self.picture.fill(0.0);
                for (shown, share) in several {
                    transport.light(raster(*shown), &mut self.part);
                    let parts = self.picture.iter_mut().zip(&self.part);
                    parts.for_each(|(sum, light)| *sum += share * light);
                }
            }
        }
        let camera = &self.scenario.rig.camera;
        blur::gaussian(
            &mut self.picture,
            camera.width as usize,
            self.scenario.optics.camera_blur_px,
        );

        let full_scale = self.scenario.full_scale();
        let sensor = Sensor {
            full_scale: full_scale as f32,
            gain: (self.brightness * full_scale) as f32,
            half_width: (self.scenario.noise.noise_counts / 255.0 * full_scale) as f32,
        };
        let random = noise_of(self.seed, self.exposed);
        self.exposed += 1;
        let plane = self
            .scenario
            .colour
            .then(|| self.scenario.in_frame(&self.picture));
        let picture = plane.as_ref().unwrap_or(&self.picture);
        self.pool.frame(timestamp, count, |pixels| match pixels {
            Pixels::Eight(samples) => sensor.read(picture, random, samples, |count| count as u8),
            Pixels::Sixteen(samples) => sensor.read(picture, random, samples, |count| count as u16),
        })
    }
}

/// Brightens a raster's light by its mean, as a projector does that adapts to the content of a picture.
fn adapt(light: &mut [f32], content_gain: f64) {
    if content_gain == 0.0 {
        return;
    }
    let sum: f64 = light.iter().copied().map(f64::from).sum();
    let factor = 1.0 + content_gain * (1.0 - sum / light.len().max(1) as f64);
    light.iter_mut().for_each(|light| *light *= factor as f32);
}

/// The random numbers of frame number `frame` with `seed`. The frame number is spread over all bits, so that neighbouring frames and
/// seeds are uncorrelated. Everything else draws from SplitMix64; Xoshiro256++ stays here because the demonstration's verdicts
/// and many measured figures depend on these frames.
fn noise_of(seed: u64, frame: u64) -> Xoshiro256PlusPlus {
    let spread = frame.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    Xoshiro256PlusPlus::seed_from_u64(seed ^ spread.rotate_left(17))
}

/// Conversion of light to counts.
struct Sensor {
    full_scale: f32,
    gain: f32,
    half_width: f32,
}

impl Sensor {
    /// Counts = gain · light + uniform noise, clipped, rounded to nearest.
    fn read<T>(
        &self,
        light: &[f32],
        mut random: Xoshiro256PlusPlus,
        samples: &mut [T],
        count: impl Fn(f32) -> T,
    ) {
        // Half of a random word in −1…1: 2⁻³¹ times a signed half.
        let unit = 1.0 / 2_147_483_648.0_f32;
        for (pair, light) in samples.chunks_mut(2).zip(light.chunks(2)) {
            let word = random.next_u64();
            for (half, (sample, light)) in pair.iter_mut().zip(light).enumerate() {
                let noise = ((word >> (32 * half)) as u32 as i32) as f32 * unit;
                let value = self.gain * light + self.half_width * noise;
                *sample = count((value.clamp(0.0, self.full_scale) + 0.5).floor());
            }
        }
    }
}
