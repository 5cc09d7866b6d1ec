//! The frames of the simulated camera, from the part in place and the rasters in view: light, blur,
//! noise and counts.
//!
//! Measured in release on one core for 512 × 512 pixels: about 3 ms per frame including noise (the
//! test `speed_of_building_a_transport_and_of_one_frame` prints it).

use std::collections::VecDeque;
use std::sync::Arc;

use super::blur::{gaussian, split};
use super::material::Material;
use super::parts::Part;
use super::placement::{Ground, Placement};
use super::scenario::Scenario;
use super::sensor::Sensor;
use super::transport::{PADDING, Transport};
use super::unsteady::{Exposed, Unsteady};
use hal::error::Error;
use hal::frame::{Frame, FrameFormat, Pixels, Pool};
use hal::projector::Raster;
use hal::units::Timestamp;
use hal::virtual_head::{InView, Scene};

/// How many frames may be kept before each further one costs an allocation.
const MAX_KEPT_FRAMES: usize = 64;
/// The pictures of the part in place are kept if those of all patterns take so many bytes at most: a
/// recipe's for 512 × 512 pixels, and less than the part's light transport takes.
const MAX_PICTURES: usize = 24 << 20;
/// The light of so many patterns is kept while exposures see one pattern change to another: the next
/// exposures often see the same two, with other shares.
const MAX_LIGHTS: usize = 3;

/// What was in view during an exposure, and at which place of the part.
type View = (usize, Vec<InView>);

/// The place of the part, and the pattern that is shown, or none.
type Shown = (usize, Option<usize>);

/// A placed part with its light transport, ready to be put in place.
#[derive(Clone, Debug)]
pub struct Staged {
    pub(super) part: Part,
    pub(super) material: Option<Material>,
    pub(super) placement: Placement,
    pub(super) floor: Option<Ground>,
    pub(super) unsteady: Unsteady,
    /// As it lies.
    pub(super) transport: Arc<Transport>,
    /// At each of the places between which it shakes.
    shaken: Vec<Arc<Transport>>,
}

impl Staged {
    pub(super) fn new(
        scenario: &Scenario,
        part: &Part,
        material: Option<Material>,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Self {
        let places = scenario.unsteady.places();
        let shaken = places.iter().enumerate().map(|(at, share)| {
            let mut placement = *placement;
            for (mm, shake) in placement
                .shift_mm
                .iter_mut()
                .zip(scenario.unsteady.shake_mm)
            {
                *mm += share * shake;
            }
            let told = |done: f64| progress((at as f64 + done) / places.len() as f64);
            Arc::new(Transport::build(
                scenario, part, material, &placement, &told,
            ))
        });
        let shaken: Vec<_> = shaken.collect();
        Self {
            part: part.clone(),
            material,
            placement: *placement,
            floor: scenario.floor.clone(),
            unsteady: scenario.unsteady,
            transport: Arc::clone(&shaken[shaken.len() / 2]),
            shaken,
        }
    }
}

/// Part, rasters and sensor of a simulated head.
pub(crate) struct SimScene {
    scenario: Arc<Scenario>,
    placed: Staged,
    /// What is loaded: as grey levels, which take a quarter of the memory of their light.
    rasters: Vec<Raster>,
    /// The light on the camera of the part in place, for what was in view.
    pictures: VecDeque<(View, Vec<f32>)>,
    /// The light of patterns that were seen with others in one exposure, before the camera's blur; the
    /// latest last.
    lights: VecDeque<(Shown, Vec<f32>)>,
    /// Pixels of the sensor.
    sensor_size: usize,
    pool: Pool,
    sensor: Sensor,
    /// The exposure relative to the scenario's, and the camera's gain.
    exposing: [f64; 2],
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
            pictures: VecDeque::new(),
            lights: VecDeque::new(),
            sensor_size: sensor,
            pool: Pool::new(format, MAX_KEPT_FRAMES),
            sensor: Sensor::new(&scenario),
            exposing: [1.0, scenario.optics.gain],
            scenario,
        }
    }

    /// Puts another part in place.
    pub(super) fn place(&mut self, placed: Staged) {
        self.placed = placed;
        self.pictures.clear();
        self.lights.clear();
    }

    /// The part in place.
    pub(super) fn placed(&self) -> Staged {
        self.placed.clone()
    }

    /// Sets the exposure relative to the scenario's, and the camera's gain.
    pub(super) fn set_exposing(&mut self, exposing: [f64; 2]) {
        self.exposing = exposing;
    }

    /// Restarts the noise with another seed.
    pub(super) fn reseed(&mut self, seed: u64) {
        self.sensor.reseed(seed);
    }

    /// The number of the picture of what is in view, with the part at one of its places, which is
    /// computed unless it is kept: frames of one pattern differ by their noise alone.
    fn picture(&mut self, place: usize, seen: &[InView]) -> usize {
        let mut known = self.pictures.iter();
        if let Some(known) = known.position(|((at, view), _)| *at == place && view == seen) {
            return known;
        }
        if self.pictures.len() > self.rasters.len() * self.placed.shaken.len() {
            self.pictures.pop_front();
        }
        let mut picture = vec![0.0; self.sensor_size];
        match seen {
            [InView { pattern, share }] => {
                self.lights.clear();
                let raster = self.lit(*pattern);
                self.placed.shaken[place].light(raster.as_deref(), &mut picture);
                picture.iter_mut().for_each(|light| *light *= share);
            }
            several => {
                for InView { pattern, share } in several {
                    let parts = picture.iter_mut().zip(self.light((place, *pattern)));
                    parts.for_each(|(sum, light)| *sum += share * light);
                }
            }
        }
        let width = self.scenario.rig.camera.width as usize;
        gaussian(&mut picture, width, self.placed.transport.blur_px);
        self.pictures.push_back(((place, seen.to_vec()), picture));
        self.pictures.len() - 1
    }

    /// The picture of what is in view where something changes; none where nothing does.
    fn changed(&mut self, seen: &[InView], timestamp: Timestamp, count: u64) -> Option<Vec<f32>> {
        let scenario = Arc::clone(&self.scenario);
        let unsteady = self.placed.unsteady;
        let shakes = unsteady.places().len() > 1;
        if unsteady.is_steady() && !shakes {
            return None;
        }
        let share = seen.iter().map(|view| view.share).sum();
        let planned = scenario.mechanics().exposure.as_secs_f64();
        let exposed = Exposed {
            start: timestamp.0 as f64 * 1e-9,
            length: planned * self.exposing[0] * f64::from(share),
            count,
        };
        let refresh = scenario.refresh().as_secs_f64();
        let light = unsteady.light(scenario.light.ambient, exposed, refresh);
        let [other, shown] = light.map(|factor| factor as f32);
        let dark = [InView {
            pattern: None,
            share,
        }];
        let mut picture = vec![0.0; self.sensor_size];
        for (place, stay) in unsteady.stays(exposed).into_iter().enumerate() {
            for (seen, share) in [(seen, shown), (&dark, other - shown)] {
                let share = share * stay as f32;
                if share != 0.0 {
                    let at = self.picture(place, seen);
                    let parts = picture.iter_mut().zip(&self.pictures[at].1);
                    parts.for_each(|(sum, light)| *sum += share * light);
                }
            }
        }
        Some(picture)
    }

    /// The light on the camera while the part is at this place and this pattern is shown, or none.
    fn light(&mut self, shown: Shown) -> &[f32] {
        let known = self.lights.iter().position(|(known, _)| *known == shown);
        let oldest = || (self.lights.len() >= MAX_LIGHTS).then_some(0);
        let kept = known.or_else(oldest).and_then(|at| self.lights.remove(at));
        let mut light = kept.map_or_else(|| vec![0.0; self.sensor_size], |(_, light)| light);
        if known.is_none() {
            let raster = self.lit(shown.1);
            self.placed.shaken[shown.0].light(raster.as_deref(), &mut light);
        }
        self.lights.push_back((shown, light));
        self.lights.back().map_or(&[], |(_, light)| light)
    }

    /// Whether there is memory for the pictures of all patterns and of none.
    fn keeps_pictures(&self) -> bool {
        (self.rasters.len() + 1) * self.placed.shaken.len() * self.sensor_size * size_of::<f32>()
            <= MAX_PICTURES
    }

    /// The light of a loaded raster, 1 = white, row by row, with [`PADDING`]; `None` where none is
    /// shown.
    fn lit(&self, shown: Option<usize>) -> Option<Vec<f32>> {
        let raster = shown.and_then(|index| self.rasters.get(index))?;
        let optics = &self.scenario.optics;
        let response: [f32; 256] = std::array::from_fn(|grey| {
            let share = grey as f64 / 255.0;
            share.powf(optics.gamma) as f32
        });
        let greys = raster.pixels().iter();
        let mut light = Vec::with_capacity(raster.pixels().len() + PADDING);
        light.extend(greys.map(|grey| response[usize::from(*grey)]));
        gaussian(
            &mut light,
            raster.width() as usize,
            split(optics.projector_blur_px).1,
        );
        adapt(&mut light, optics.content_gain);
        light.resize(light.len() + PADDING, 0.0);
        Some(light)
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

    fn load(&mut self, kept: usize, rasters: Vec<Raster>) -> Result<(), Error> {
        let stays = |shown: &Option<usize>| shown.is_none_or(|index| index < kept);
        self.pictures
            .retain(|((_, view), _)| view.iter().all(|seen| stays(&seen.pattern)));
        self.lights.retain(|((_, shown), _)| stays(shown));
        // Teaching holds more frames at a time than a cycle.
        self.pool.release();
        self.rasters.truncate(kept);
        self.rasters.extend(rasters);
        Ok(())
    }

    fn loaded(&self) -> usize {
        self.rasters.len()
    }

    fn expose(
        &mut self,
        seen: &[InView],
        timestamp: Timestamp,
        count: u64,
    ) -> Result<Frame, Error> {
        let changed = self.changed(seen, timestamp, count);
        let middle = self.placed.shaken.len() / 2;
        let at = self.picture(middle, seen);
        let (random, exposing) = (self.sensor.next_frame(), self.exposing);
        let whole = changed.as_ref().unwrap_or(&self.pictures[at].1);
        let plane = self.scenario.colour.then(|| self.scenario.in_frame(whole));
        let picture = plane.as_ref().unwrap_or(whole);
        let sensor = &self.sensor;
        let frame = self.pool.frame(timestamp, count, |pixels| match pixels {
            Pixels::Eight(samples) => sensor.read(exposing, picture, random, samples, |n| n as u8),
            Pixels::Sixteen(samples) => {
                sensor.read(exposing, picture, random, samples, |n| n as u16);
            }
        });
        if !self.keeps_pictures() {
            self.pictures.clear();
        }
        frame
    }
}

/// Brightens a raster's light by its mean, as a projector does that adapts to the content of a
/// picture.
fn adapt(light: &mut [f32], content_gain: f64) {
    if content_gain == 0.0 {
        return;
    }
    let sum: f64 = light.iter().copied().map(f64::from).sum();
    let factor = 1.0 + content_gain * (1.0 - sum / light.len().max(1) as f64);
    light.iter_mut().for_each(|light| *light *= factor as f32);
}
