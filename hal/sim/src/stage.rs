//! The simulated head and its stage, on which parts are placed and which knows their true heights.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::material::Material;
use super::parts::Part;
use super::placement::{Ground, Placement};
use super::scenario::Scenario;
use super::scene::{SimScene, Staged};
use super::transport::Truth;
use super::unsteady::Unsteady;
use hal::bounds::{Bound, Fields, within};
use hal::error::{DeviceKind, Error};
use hal::head::Head;
use hal::virtual_head::{self, Control, Scene as _};

/// Placed parts whose light transport is kept; one that fills 512 × 512 pixels takes about 40 MB
/// (lens of σ 0.5 px).
const MAX_REMEMBERED: usize = 8;

/// The part in front of a simulated head. Clones place parts in front of the same head.
#[derive(Clone)]
pub struct Stage {
    control: Control<SimScene>,
    scenario: Arc<Scenario>,
    /// Light transports of the last placed parts; the most recent is the last.
    remembered: Arc<Mutex<Vec<Staged>>>,
    gain: Arc<Mutex<f64>>,
    /// What the next part lies on and among.
    floor: Arc<Mutex<Option<Ground>>>,
    /// How light and part change in time once the next part is placed.
    unsteady: Arc<Mutex<Unsteady>>,
}

/// A simulated head in front of the scenario's part, and the stage to place others on.
///
/// # Errors
/// `Unsupported` if a value of the scenario is out of its range.
pub fn head(scenario: &Scenario) -> Result<(Head, Stage), Error> {
    head_with_progress(scenario, &|_| ())
}

/// As [`head`]; `progress` is called with the share of the light transport that is computed, 0…1,
/// from any thread.
///
/// # Errors
/// As [`head`].
pub fn head_with_progress(
    scenario: &Scenario,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(Head, Stage), Error> {
    scenario
        .check()
        .map_err(|problem| Error::unsupported("simulating this scenario", problem))?;
    let scenario = Arc::new(scenario.clone());
    let staged = Staged::new(
        &scenario,
        &scenario.part,
        scenario.material,
        &scenario.placement,
        progress,
    );
    let scene = SimScene::new(Arc::clone(&scenario), staged.clone());
    let (mut head, control) = virtual_head::head(scene, scenario.mechanics());
    head.set_clipping(scenario.clips_from().filter(|_| scenario.calibrated));
    let stage = Stage {
        control,
        gain: Arc::new(Mutex::new(scenario.optics.gain)),
        floor: Arc::new(Mutex::new(scenario.floor.clone())),
        unsteady: Arc::new(Mutex::new(scenario.unsteady)),
        scenario,
        remembered: Arc::new(Mutex::new(vec![staged])),
    };
    Ok((head, stage))
}

impl Stage {
    /// Replaces the part by another of the scenario's material; the next exposure sees the new one.
    /// The light transport of the last few parts is kept, so going back to one of them takes no
    /// time.
    ///
    /// # Errors
    /// `Unsupported` if a measure of the part or the placement is out of its range.
    pub fn place(&self, part: &Part, placement: &Placement) -> Result<(), Error> {
        self.place_with_progress(part, self.scenario.material, placement, &|_| ())
    }

    /// As [`Stage::place`], with a part of this material; without one the scenario's `light` says
    /// how it reflects. `progress` is called with the share done, 0…1, from any thread.
    ///
    /// # Errors
    /// As [`Stage::place`].
    pub fn place_with_progress(
        &self,
        part: &Part,
        material: Option<Material>,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(), Error> {
        let (floor, unsteady) = (self.floor(), self.unsteady());
        let known = |staged: &Staged| {
            let world = staged.floor == floor && staged.unsteady == unsteady;
            let same = staged.part == *part && world;
            same && staged.material == material && staged.placement == *placement
        };
        let recalled = {
            let mut remembered = self.remembered();
            let at = remembered.iter().position(known);
            at.map(|at| remembered.remove(at))
        };
        let staged = match recalled {
            Some(known) => known,
            None => self.work_out(part, material, placement, progress)?,
        };
        let mut remembered = self.remembered();
        if remembered.len() >= MAX_REMEMBERED / unsteady.places().len() {
            remembered.remove(0);
        }
        remembered.push(staged.clone());
        self.show(staged);
        Ok(())
    }

    /// Computes the light transport of `part` of a material, if any, without putting it in place.
    /// This is what takes long; meanwhile frames may be taken of the present part. `progress` is
    /// called with the share done, 0…1, from any thread.
    ///
    /// # Errors
    /// `Unsupported` if a measure of the part or the placement is out of its range.
    pub fn work_out(
        &self,
        part: &Part,
        material: Option<Material>,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Staged, Error> {
        part.check()
            .and_then(|()| Ok(Fields.check("placement", placement)?))
            .map_err(|problem| Error::unsupported("placing this part", problem))?;
        let scenario = Scenario {
            floor: self.floor(),
            unsteady: self.unsteady(),
            ..Scenario::clone(&self.scenario)
        };
        Ok(Staged::new(&scenario, part, material, placement, progress))
    }

    /// Lays this, or nothing, below and beside the parts that are placed from now on.
    ///
    /// # Errors
    /// `Unsupported` if a measure is out of its range.
    pub fn surround(&self, floor: Option<Ground>) -> Result<(), Error> {
        let checked = floor
            .as_ref()
            .map_or(Ok(()), |floor| Fields.check("floor", floor));
        checked.map_err(|problem| Error::unsupported("laying this floor", problem))?;
        *self.floor.lock().unwrap_or_else(PoisonError::into_inner) = floor;
        Ok(())
    }

    /// Lets light and parts that are placed from now on change so in time.
    ///
    /// # Errors
    /// `Unsupported` if a value is out of its range.
    pub fn unsettle(&self, unsteady: Unsteady) -> Result<(), Error> {
        let checked = Fields.check("unsteady", &unsteady);
        checked.map_err(|problem| Error::unsupported("changing the light", problem))?;
        *self.unsteady.lock().unwrap_or_else(PoisonError::into_inner) = unsteady;
        Ok(())
    }

    /// How light and parts that are placed change in time.
    #[must_use]
    pub fn unsteady(&self) -> Unsteady {
        *self.unsteady.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What parts that are placed lie on and among.
    #[must_use]
    pub fn floor(&self) -> Option<Ground> {
        let floor = self.floor.lock().unwrap_or_else(PoisonError::into_inner);
        floor.clone()
    }

    /// Puts a part in place whose light transport is computed; the next exposure sees it.
    pub fn show(&self, staged: Staged) {
        self.control.scene(|scene| scene.place(staged));
    }

    /// The part that is in place, its material, and how it lies.
    #[must_use]
    pub fn placed(&self) -> (Part, Option<Material>, Placement) {
        let staged = self.control.scene(|scene| scene.placed());
        (staged.part, staged.material, staged.placement)
    }

    fn remembered(&self) -> MutexGuard<'_, Vec<Staged>> {
        self.remembered
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Unplugs a device: each of its calls fails until it is plugged in and the head opened again.
    pub fn unplug(&self, device: DeviceKind) {
        self.control.plug(device, false);
        if device == DeviceKind::Projector {
            // The projector loses the patterns in its memory. Loading none never fails.
            let _ = self.control.scene(|scene| scene.load(0, Vec::new()));
        }
    }

    /// Plugs a device in again.
    pub fn plug(&self, device: DeviceKind) {
        self.control.plug(device, true);
    }

    /// Opens the head again, in front of the same part.
    ///
    /// # Errors
    /// `Disconnected` if camera or projector is unplugged.
    pub fn reopen(&self) -> Result<Head, Error> {
        let mut head = self.control.reopen()?;
        let known = self.scenario.calibrated;
        head.set_clipping(self.scenario.clips_from().filter(|_| known));
        Ok(head)
    }

    /// The exposure and the gain of the camera.
    #[must_use]
    pub fn exposing(&self) -> (Duration, f64) {
        let gain = self.gain.lock().unwrap_or_else(PoisonError::into_inner);
        (self.control.exposure(), *gain)
    }

    /// Sets the exposure and the gain of the camera. Longer exposures get more light, and more gain
    /// makes more counts of it.
    ///
    /// # Errors
    /// `Unsupported` if the camera runs by itself with a shorter period, or the gain is out of its
    /// range.
    pub fn expose(&self, exposure: Duration, gain: f64) -> Result<(), Error> {
        let period = Duration::from_micros(self.scenario.timing.camera_period_us);
        if !period.is_zero() && exposure > period {
            return Err(Error::unsupported(
                format!("exposing for {exposure:?} every {period:?}"),
                "expose for less than the camera's period",
            ));
        }
        within("gain", gain, 0.0, 100.0)
            .map_err(|problem| Error::unsupported("setting the gain", problem))?;
        let planned = self.scenario.mechanics().exposure;
        let longer = exposure.as_secs_f64() / planned.as_secs_f64();
        self.control.set_exposure(exposure);
        self.control
            .scene(|scene| scene.set_exposing([longer, gain]));
        *self.gain.lock().unwrap_or_else(PoisonError::into_inner) = gain;
        Ok(())
    }

    /// The true heights and classes of the part that is in place, per pixel of a frame.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let staged = self.control.scene(|scene| scene.placed());
        let truth = &staged.transport.truth;
        Truth {
            height: self.scenario.in_frame(&truth.height),
            class: self.scenario.in_frame(&truth.class),
        }
    }

    /// Restarts the noise with `seed`: the next frame has the noise of frame 0.
    pub fn reseed(&self, seed: u64) {
        self.control.scene(|scene| scene.reseed(seed));
    }

    /// The scenario of this head, with the part it started with.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }
}
