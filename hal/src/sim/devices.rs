//! The simulated devices: the camera sees what the projector shows, on the part that was placed.
//!
//! Measured on one core: see the README of this crate.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::blur;
use super::parts::Part;
use super::scenario::{Placement, Scenario};
use super::transport::{Transport, Truth};
use crate::error::Error;
use crate::frame::{Frame, FrameFormat, Pixels, Pool};
use crate::head::DynHead;
use crate::model::DeviceModel;
use crate::projector::Raster;
use crate::units::Timestamp;
use crate::virtual_head::{self, Scene, Shared, lock};

/// Placed parts whose transport is remembered; one of 512 × 512 takes about 20 MB.
const MAX_REMEMBERED: usize = 8;
/// Frames that a user may keep before each new one costs an allocation.
const MAX_KEPT_FRAMES: usize = 64;

/// The part in front of a simulated head. Clones place parts in front of the same head.
#[derive(Clone)]
pub struct Stage {
    bench: Shared<SimScene>,
    scenario: Arc<Scenario>,
    remembered: Arc<Mutex<Vec<Remembered>>>,
}

/// A placed part whose transport is known; the one used last stands at the end.
struct Remembered {
    part: Part,
    placement: Placement,
    transport: Arc<Transport>,
}

/// A simulated head in front of the scenario's part, and the stage to place others on.
///
/// # Errors
/// `Unsupported` if a value of the scenario is out of its range.
pub fn head(scenario: &Scenario) -> Result<(DynHead, Stage), Error> {
    head_with_progress(scenario, &|_| ())
}

/// As [`head`]; `progress` is told the share of the light transport that is worked out, 0…1, from any thread.
///
/// # Errors
/// As [`head`].
pub fn head_with_progress(
    scenario: &Scenario,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(DynHead, Stage), Error> {
    scenario
        .check()
        .map_err(|problem| Error::unsupported("simulating this scenario", problem))?;
    let scenario = Arc::new(scenario.clone());
    let transport = Arc::new(Transport::build(
        &scenario,
        &scenario.part,
        &scenario.placement,
        progress,
    ));
    let remembered = Remembered {
        part: scenario.part.clone(),
        placement: scenario.placement,
        transport: Arc::clone(&transport),
    };
    let refresh = Duration::from_secs_f64(1.0 / scenario.refresh_hz);
    let (head, bench) =
        virtual_head::head(SimScene::new(Arc::clone(&scenario), transport), refresh);
    let stage = Stage {
        bench,
        scenario,
        remembered: Arc::new(Mutex::new(vec![remembered])),
    };
    Ok((head, stage))
}

impl Stage {
    /// Puts `part` in place of the one before; the next exposure sees it. The transport of the last few placed parts is
    /// remembered, so going back to one of them costs nothing.
    ///
    /// # Errors
    /// `Unsupported` if a measure of the part or the placement is out of its range.
    pub fn place(&self, part: &Part, placement: &Placement) -> Result<(), Error> {
        self.place_with_progress(part, placement, &|_| ())
    }

    /// As [`Stage::place`]; `progress` is told the share done, 0…1, from any thread.
    ///
    /// # Errors
    /// As [`Stage::place`].
    pub fn place_with_progress(
        &self,
        part: &Part,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(), Error> {
        part.check()
            .and_then(|()| placement.check())
            .map_err(|problem| Error::unsupported("placing this part", problem))?;
        let known = self.recall(part, placement);
        let transport = known.unwrap_or_else(|| {
            let built = Arc::new(Transport::build(&self.scenario, part, placement, progress));
            self.remember(part, placement, &built);
            built
        });
        lock(&self.bench).scene.transport = transport;
        Ok(())
    }

    fn recall(&self, part: &Part, placement: &Placement) -> Option<Arc<Transport>> {
        let mut remembered = self
            .remembered
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let at = remembered
            .iter()
            .position(|r| r.part == *part && r.placement == *placement)?;
        let found = remembered.remove(at);
        let transport = Arc::clone(&found.transport);
        remembered.push(found);
        Some(transport)
    }

    fn remember(&self, part: &Part, placement: &Placement, transport: &Arc<Transport>) {
        let mut remembered = self
            .remembered
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if remembered.len() == MAX_REMEMBERED {
            remembered.remove(0);
        }
        let (part, transport) = (part.clone(), Arc::clone(transport));
        remembered.push(Remembered {
            part,
            placement: *placement,
            transport,
        });
    }

    /// What is true of the part that is in place.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let transport = Arc::clone(&lock(&self.bench).scene.transport);
        transport.truth.clone()
    }

    /// Starts the noise anew from `seed`: the next frame is frame 0 of it.
    pub fn reseed(&self, seed: u64) {
        let mut bench = lock(&self.bench);
        bench.scene.seed = seed;
        bench.scene.exposed = 0;
    }

    /// The scenario of this head, with the part it started with.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The exact geometry of the camera.
    #[must_use]
    pub fn camera_model(&self) -> DeviceModel {
        self.scenario.rig.camera.model()
    }

    /// The exact geometry of the projector.
    #[must_use]
    pub fn projector_model(&self) -> DeviceModel {
        self.scenario.rig.projector.model()
    }

    /// Refresh period of the projector.
    #[must_use]
    pub fn refresh(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.scenario.refresh_hz)
    }
}

/// Part, rasters and sensor of a simulated head.
pub(crate) struct SimScene {
    scenario: Arc<Scenario>,
    transport: Arc<Transport>,
    /// The light of each loaded raster, 1 = white, row by row.
    rasters: Vec<Vec<f32>>,
    /// The light on the camera, used again for each frame.
    picture: Vec<f32>,
    pool: Pool,
    seed: u64,
    exposed: u64,
}

impl SimScene {
    fn new(scenario: Arc<Scenario>, transport: Arc<Transport>) -> Self {
        let camera = &scenario.rig.camera;
        let format = FrameFormat::packed(camera.width, camera.height, scenario.bit_depth);
        Self {
            transport,
            rasters: Vec::new(),
            picture: vec![0.0; format.samples()],
            pool: Pool::new(format, MAX_KEPT_FRAMES),
            seed: scenario.noise.seed,
            exposed: 0,
            scenario,
        }
    }
}

impl Scene for SimScene {
    fn format(&self) -> FrameFormat {
        let camera = &self.scenario.rig.camera;
        FrameFormat::packed(camera.width, camera.height, self.scenario.bit_depth)
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
                optics.projector_blur_px,
            );
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
        shown: Option<usize>,
        timestamp: Timestamp,
        sequence: u64,
    ) -> Result<Frame, Error> {
        let raster = shown
            .and_then(|index| self.rasters.get(index))
            .map(Vec::as_slice);
        self.transport.light(raster, &mut self.picture);
        let camera = &self.scenario.rig.camera;
        blur::gaussian(
            &mut self.picture,
            camera.width as usize,
            self.scenario.optics.camera_blur_px,
        );

        let full_scale = self.scenario.full_scale();
        let sensor = Sensor {
            full_scale: full_scale as f32,
            gain: (self.scenario.optics.gain * full_scale) as f32,
            half_width: (self.scenario.noise.noise_counts / 255.0 * full_scale) as f32,
        };
        let random = noise_of(self.seed, self.exposed);
        self.exposed += 1;
        let picture = &self.picture;
        self.pool.frame(timestamp, sequence, |pixels| match pixels {
            Pixels::Eight(samples) => sensor.read(picture, random, samples, |count| count as u8),
            Pixels::Sixteen(samples) => sensor.read(picture, random, samples, |count| count as u16),
        })
    }
}

/// The noise of frame number `frame` under `seed`. Both are spread over all bits, so that neighbouring frames and
/// seeds have nothing in common.
fn noise_of(seed: u64, frame: u64) -> Xoshiro256PlusPlus {
    let spread = frame.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    Xoshiro256PlusPlus::seed_from_u64(seed ^ spread.rotate_left(17))
}

/// How light becomes counts.
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
