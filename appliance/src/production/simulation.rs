//! The part in front of a simulated head: shows which one it is and which there are, and replaces
//! it by another.
//!
//! The light of a new part is computed on the caller's thread, which takes seconds, while the
//! station measures the part before. Then the measuring task puts the part in place between two
//! cycles, so that the frames of a cycle never show two parts.

use crate::head::placed::{Placed, kinds};
use crate::production::Order;
use serde_json::{Value, json};
use sim::{Clamp, Ground, Material, Pin, Stage, Staged};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender, SyncSender};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// Longest wait for the measuring task, which may be in the middle of a cycle.
const PATIENCE: Duration = Duration::from_secs(3);

/// An example of a floor, and of all that can stand on one.
fn floors() -> Ground {
    Ground {
        pins: vec![Pin {
            x: -85.0,
            y: 35.0,
            ..Pin::default()
        }],
        clamps: vec![Clamp {
            low: [-100.0, -35.0, -5.0],
            high: [-82.0, 5.0, 20.0],
        }],
        next_mm: Some([165.0, 0.0]),
        ..Ground::default()
    }
}

/// Why a part was not put in place, in words with the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PutError {
    /// There is no such part, or the head is not simulated.
    #[error("{0}")]
    Unfit(String),
    /// The measuring task is busy, or another part is being put in place.
    #[error("{0}")]
    Busy(String),
}

/// Access to the part in front of a simulated head. Cheap to clone.
#[derive(Clone)]
pub struct Simulation {
    stage: Arc<OnceLock<Stage>>,
    orders: Sender<Order>,
    placing: Arc<AtomicBool>,
}

/// While it is there, a part is being put in place.
struct Alone(Arc<AtomicBool>);

impl Drop for Alone {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

impl Simulation {
    /// For the measuring task that takes these orders.
    pub fn new(orders: Sender<Order>) -> Self {
        Self {
            stage: Arc::default(),
            orders,
            placing: Arc::default(),
        }
    }

    /// The head is open; `stage` is where parts are placed if it is simulated.
    pub fn opened(&self, stage: Option<&Stage>) {
        if let Some(stage) = stage {
            // A head that is opened again has the same stage.
            let _ = self.stage.set(stage.clone());
        }
    }

    /// The part that is in place, and those that may be put there, as `GET /api/simulation/part`
    /// answers.
    pub fn view(&self) -> Value {
        match self.stage.get() {
            None => json!({ "simulated": false }),
            Some(stage) => {
                let (part, material, placement) = stage.placed();
                let materials = Material::ALL.map(|(_, name)| name);
                json!({
                    "simulated": true,
                    "part": part,
                    "material": material,
                    "placement": placement,
                    "floor": stage.floor(),
                    "floors": floors(),
                    "unsteady": stage.unsteady(),
                    "kinds": kinds(),
                    "materials": materials,
                })
            }
        }
    }

    /// Whether a part is being put in place: until it is there, the head sees the one before.
    pub fn is_placing(&self) -> bool {
        self.placing.load(Ordering::Acquire)
    }

    /// Puts a part in place; returns when the next cycle sees it, after seconds.
    ///
    /// # Errors
    /// If the head is not simulated, the part is impossible, or the measuring task is busy.
    pub fn put(&self, placed: &Placed) -> Result<(), PutError> {
        let unfit = |words: String| PutError::Unfit(format!("put the part in place: {words}"));
        let stage = self.stage.get().ok_or_else(|| {
            unfit("the head is not simulated: its part is the one that lies there".into())
        })?;
        placed.check().map_err(|error| unfit(error.to_string()))?;
        if self.placing.swap(true, Ordering::AcqRel) {
            let words =
                "put the part in place: another one is being put there; try again when it is";
            return Err(PutError::Busy(words.into()));
        }
        let _alone = Alone(self.placing.clone());
        let unlaid = |error: hal::error::Error| PutError::Unfit(error.to_string());
        if let Some(floor) = &placed.floor {
            stage.surround(floor.clone()).map_err(unlaid)?;
        }
        if let Some(unsteady) = placed.unsteady {
            stage.unsettle(unsteady).map_err(unlaid)?;
        }
        let staged = stage
            .work_out(&placed.part, placed.material, &placed.placement, &|_| ())
            .map_err(unlaid)?;
        let (done, in_place) = mpsc::sync_channel(1);
        let waiting = Arc::new(Mutex::new(Some(staged)));
        let placing = Placing {
            stage: stage.clone(),
            waiting: waiting.clone(),
            done,
        };
        // If the measuring task is gone, `placing` and with it the sender of the answer are
        // dropped.
        drop(self.orders.send(Order::Place(placing)));
        let busy = || {
            let words = "put the part in place: the measuring task is busy or its head is lost; try again when it is ready";
            Err(PutError::Busy(words.into()))
        };
        match in_place.recv_timeout(PATIENCE) {
            Ok(()) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => busy(),
            // The part is taken back, unless it is being put in place at this moment.
            Err(RecvTimeoutError::Timeout) => match taken(&waiting) {
                Some(_) => busy(),
                None => in_place.recv().or_else(|_| busy()),
            },
        }
    }
}

/// A part that the measuring task is to put in front of the head.
pub struct Placing {
    stage: Stage,
    waiting: Arc<Mutex<Option<Staged>>>,
    done: SyncSender<()>,
}

impl Placing {
    /// Puts it in place, unless the requester has given up.
    pub fn carry_out(self) {
        if let Some(staged) = taken(&self.waiting) {
            self.stage.show(staged);
            let _ = self.done.send(());
        }
    }
}

fn taken(waiting: &Mutex<Option<Staged>>) -> Option<Staged> {
    let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
    waiting.take()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::placed::Placed;
    use sim::{Part, Scenario};

    fn small() -> (Simulation, mpsc::Receiver<Order>, Stage) {
        let mut scenario = Scenario {
            sub_rays: 1,
            ..Scenario::default()
        };
        (scenario.rig.camera.width, scenario.rig.camera.height) = (32, 32);
        let (_, stage) = sim::head(&scenario).unwrap();
        let (orders, inbox) = mpsc::channel();
        let simulation = Simulation::new(orders);
        simulation.opened(Some(&stage));
        (simulation, inbox, stage)
    }

    #[test]
    fn a_part_is_in_place_only_once_the_measuring_task_has_put_it_there() {
        let (simulation, inbox, stage) = small();
        let other = Placed {
            material: Some(Material::Oiled),
            ..Placed::stock("plane").unwrap()
        };
        let putting = {
            let (simulation, other) = (simulation.clone(), other.clone());
            std::thread::spawn(move || simulation.put(&other))
        };
        let Order::Place(placing) = inbox.recv().unwrap() else {
            panic!("another order");
        };
        assert_eq!(stage.placed().0, Part::default());
        assert!(!putting.is_finished());
        placing.carry_out();
        assert_eq!(putting.join().unwrap(), Ok(()));
        let there = (other.part, other.material, other.placement);
        assert_eq!(stage.placed(), there);
    }

    #[test]
    fn a_part_that_the_measuring_task_does_not_take_is_taken_back() {
        let (simulation, inbox, stage) = small();
        let before = stage.placed();
        let other = Placed::stock("plane").unwrap();
        // As a lost head drops its orders.
        let dropping = std::thread::spawn(move || drop(inbox.recv().unwrap()));
        assert!(matches!(simulation.put(&other), Err(PutError::Busy(_))));
        dropping.join().unwrap();
        let (silent, late, _) = small();
        assert!(matches!(silent.put(&other), Err(PutError::Busy(_))));
        let Order::Place(placing) = late.recv().unwrap() else {
            panic!("another order");
        };
        placing.carry_out();
        assert_eq!(stage.placed(), before);
        assert_eq!(silent.stage.get().unwrap().placed(), before);
    }

    #[test]
    fn only_a_simulated_head_is_shown_other_parts() {
        let simulation = Simulation::new(mpsc::channel().0);
        assert_eq!(simulation.view(), json!({ "simulated": false }));
        let error = simulation.put(&Placed::default()).unwrap_err();
        assert!(error.to_string().contains("not simulated"), "{error}");
    }
}
