//! The simulated head and its stage: parts are placed in front of it, and what is true of them is known.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::parts::Part;
use super::scenario::{Placement, Scenario};
use super::scene::SimScene;
use super::transport::{Transport, Truth};
use hal::error::{Device, Error};
use hal::head::DynHead;
use hal::model::DeviceModel;
use hal::virtual_head::{self, Control, Scene as _};

/// Placed parts whose transport is remembered; one of 512 × 512 takes about 20 MB.
const MAX_REMEMBERED: usize = 8;

/// The part in front of a simulated head. Clones place parts in front of the same head.
#[derive(Clone)]
pub struct Stage {
    control: Control<SimScene>,
    scenario: Arc<Scenario>,
    placed: Arc<Mutex<(Part, Placement)>>,
    /// The one used last stands at the end.
    remembered: Arc<Mutex<Vec<Staged>>>,
}

/// A part whose light is worked out where it is to lie, ready to be put in place.
#[derive(Clone, Debug)]
pub struct Staged {
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
    let remembered = Staged {
        part: scenario.part.clone(),
        placement: scenario.placement,
        transport: Arc::clone(&transport),
    };
    let scene = SimScene::new(Arc::clone(&scenario), transport);
    let (head, control) = virtual_head::head(scene, scenario.mechanics());
    let stage = Stage {
        control,
        placed: Arc::new(Mutex::new((scenario.part.clone(), scenario.placement))),
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
        let staged = match self.recall(part, placement) {
            Some(known) => known,
            None => self.work_out(part, placement, progress)?,
        };
        self.remember(&staged);
        self.show(staged);
        Ok(())
    }

    /// Works out the light of `part` without putting it in place, which takes the longest: frames may be taken of the part before
    /// meanwhile. `progress` is told the share done, 0…1, from any thread.
    ///
    /// # Errors
    /// `Unsupported` if a measure of the part or the placement is out of its range.
    pub fn work_out(
        &self,
        part: &Part,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Staged, Error> {
        part.check()
            .and_then(|()| placement.check())
            .map_err(|problem| Error::unsupported("placing this part", problem))?;
        let transport = Transport::build(&self.scenario, part, placement, progress);
        Ok(Staged {
            part: part.clone(),
            placement: *placement,
            transport: Arc::new(transport),
        })
    }

    /// Puts a part in place whose light is worked out; the next exposure sees it.
    pub fn show(&self, staged: Staged) {
        let mut placed = self.placed.lock().unwrap_or_else(PoisonError::into_inner);
        self.control.scene(|scene| scene.place(staged.transport));
        *placed = (staged.part, staged.placement);
    }

    /// The part that is in place, and where it lies.
    #[must_use]
    pub fn placed(&self) -> (Part, Placement) {
        let placed = self.placed.lock().unwrap_or_else(PoisonError::into_inner);
        placed.clone()
    }

    fn recall(&self, part: &Part, placement: &Placement) -> Option<Staged> {
        let mut remembered = self
            .remembered
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let at = remembered
            .iter()
            .position(|r| r.part == *part && r.placement == *placement)?;
        Some(remembered.remove(at))
    }

    fn remember(&self, staged: &Staged) {
        let mut remembered = self
            .remembered
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if remembered.len() == MAX_REMEMBERED {
            remembered.remove(0);
        }
        remembered.push(staged.clone());
    }

    /// Pulls a device's cable out: every call of it fails from now on, until it is plugged in and the head opened again.
    pub fn unplug(&self, device: Device) {
        self.control.plug(device, false);
        if device == Device::Projector {
            // Patterns live in the projector's memory. A simulated one refuses no load.
            let _ = self.control.scene(|scene| scene.load(Vec::new()));
        }
    }

    /// Plugs a device in again.
    pub fn plug(&self, device: Device) {
        self.control.plug(device, true);
    }

    /// Opens the head again, in front of the same part.
    ///
    /// # Errors
    /// `Disconnected` if camera or projector is pulled out.
    pub fn reopen(&self) -> Result<DynHead, Error> {
        self.control.reopen()
    }

    /// What is true of the part that is in place.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let transport = self.control.scene(|scene| scene.transport());
        transport.truth.clone()
    }

    /// Starts the noise anew from `seed`: the next frame is frame 0 of it.
    pub fn reseed(&self, seed: u64) {
        self.control.scene(|scene| scene.reseed(seed));
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
        self.scenario.refresh()
    }
}
