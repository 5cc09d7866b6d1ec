//! The snapshot: one immutable copy of what the station shows. Registers and page are two views of
//! it. It says also why a trigger would be rejected: the number for the PLC, and the words for people.

use super::clock::Micros;
use super::control::{self, BY_PART_NUMBER, ControlRegisters};
use super::fault::Fault;
use super::health::Health;
use super::machine::{Identity, Station};
use super::recipes::{ActiveRecipe, RecipeResult};
use super::result::ResultRecord;
use super::results::Counts;
use super::state::{LoadProgress, State, TeachProgress};
use std::sync::Arc;

/// STATUS bits, register 100.
pub mod status {
    bits! {
        /// The PLC asks for ONLINE and the station neither boots nor stops.
        ONLINE = 0;
        /// A trigger would be accepted.
        READY = 1;
        /// Exposing.
        BUSY = 2;
        /// Computing.
        PROCESSING = 3;
        /// The part may move.
        EXPOSURE_DONE = 4;
        /// RESULT holds an unacknowledged result of the last trigger.
        RESULT_VALID = 5;
        /// Inverts with every result.
        RESULT_TOGGLE = 6;
        /// Follows CONTROL.1.
        TRIGGER_ACK = 7;
        /// A recipe is being loaded.
        RECIPE_LOADING = 8;
        /// The requested recipe is the active one.
        RECIPE_OK = 9;
        /// A bit of WARNING is set.
        WARNING = 10;
        /// ERROR_CODE is not 0.
        ERROR = 11;
        /// A trigger was rejected; latched.
        MISSED_TRIGGER = 12;
        /// A result was not queued; latched.
        BUFFER_OVERFLOW = 13;
        /// The head warms up.
        WARMING_UP = 14;
        /// The calibration is there and fits.
        CALIBRATION_VALID = 15;
    }
}

/// WARNING bits, register 103.
pub mod warning {
    bits! {
        /// The head is too warm or too cold.
        TEMPERATURE = 0, "temperature";
        /// Storage is nearly full or slow.
        STORAGE = 1, "storage";
        /// PLC_HEARTBEAT stands still.
        PLC_LOST = 2, "PLC lost";
        /// The clock is not synchronised.
        CLOCK_UNSYNCED = 3, "clock not synchronised";
        /// Too little light comes back.
        LOW_LIGHT = 4, "low light";
        /// Too much light comes back.
        SATURATION = 5, "saturation";
        /// The adaptive pattern no longer fits the part.
        PATTERN_UNFIT = 6, "pattern unfit";
        /// Camera and projector slipped by a frame.
        FRAME_SLIP = 7, "frame slip";
        /// The computer's supply is too weak, or the computer slows itself down.
        POWER = 8, "power";
        /// Camera and projector no longer stand to each other as they were calibrated.
        GEOMETRY = 9, "geometry";
        /// Light changes from frame to frame.
        UNSTEADY_LIGHT = 10, "unsteady light";
    }

    /// The warnings that the frames of a part show.
    pub const OF_A_PART: u16 = LOW_LIGHT | SATURATION | PATTERN_UNFIT | FRAME_SLIP | UNSTEADY_LIGHT;
}

/// REJECT_REASON, register 120: why the last rejected request was rejected.
pub mod reject {
    /// The station is busy, boots or stops.
    pub const NOT_READY: u16 = 1;
    /// The PLC does not ask for ONLINE.
    pub const OFFLINE: u16 = 2;
    /// No recipe is active.
    pub const NO_RECIPE: u16 = 3;
    /// The config does not let the PLC teach.
    pub const TEACH_NOT_ALLOWED: u16 = 4;
    /// The station has a fault, or the number of a result is still to be stored.
    pub const FAULT: u16 = 5;
    /// The recipe of RECIPE_SELECT is not the active one, or the last load failed.
    pub const OTHER_RECIPE: u16 = 6;
}

/// Everything that Modbus and the page show.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// When it was taken.
    pub at: Micros,
    /// Register 104.
    pub state: u16,
    /// The word for it.
    pub state_word: &'static str,
    /// STATUS, see [`status`].
    pub status: u16,
    /// WARNING, see [`warning`].
    pub warnings: u16,
    /// HEARTBEAT of the measuring task.
    pub heartbeat: u16,
    /// Whether the measuring task meets its deadlines.
    pub worker_alive: bool,
    /// ERROR_CODE: the fault's, else the last failed cycle's.
    pub error_code: u16,
    /// The words for it.
    pub error: Option<Arc<str>>,
    /// The fault, while there is one.
    pub fault: Option<Fault>,
    /// What the PLC wrote.
    pub control: ControlRegisters,
    /// The active recipe.
    pub recipe: Option<ActiveRecipe>,
    /// REQUESTED_RECIPE.
    pub requested_recipe: u16,
    /// RECIPE_RESULT.
    pub recipe_result: RecipeResult,
    /// Accepted triggers.
    pub triggers: u32,
    /// SEQ of the last result.
    pub result_seq: u32,
    /// Rejected triggers.
    pub missed: u32,
    /// The last accepted token.
    pub last_token: u16,
    /// The token of the API's request that is being measured.
    pub request: Option<Arc<str>>,
    /// Results waiting for RESULT_ACK.
    pub buffered: u16,
    /// REJECT_REASON, see [`reject`].
    pub reject_reason: u16,
    /// Why a trigger would be rejected now, see [`reject`]; `None` exactly while
    /// READY.
    pub refusal: Option<u16>,
    /// Seconds since the start.
    pub uptime_s: u32,
    /// BOOT_ID: random, new with each start.
    pub boot_id: u32,
    /// Names of this device.
    pub identity: Arc<Identity>,
    /// Results since the start, by verdict.
    pub counts: Counts,
    /// The last result of this run.
    pub result: Option<Arc<ResultRecord>>,
    /// The oldest unacknowledged result.
    pub oldest: Option<Arc<ResultRecord>>,
    /// While loading.
    pub load: Option<LoadProgress>,
    /// While teaching.
    pub teach: Option<TeachProgress>,
    /// Measured values of system, head and clients.
    pub health: Health,
}

impl Snapshot {
    /// ACTIVE_RECIPE, if there is one.
    pub fn active(&self) -> Option<u16> {
        self.recipe.as_ref().map(|recipe| recipe.number)
    }

    /// Whether the station is busy with something that ends by itself: every state but ready,
    /// offline and fault.
    pub fn is_working(&self) -> bool {
        !matches!(self.state, 1 | 6 | 7)
    }

    /// Whether nothing is under way and nothing is wrong: the head may be used for something else.
    pub fn is_at_rest(&self) -> bool {
        !self.is_working() && self.fault.is_none()
    }

    /// Whether a STATUS bit is set.
    pub fn is(&self, bit: u16) -> bool {
        self.status & bit != 0
    }
}

impl Station {
    /// The snapshot as of the last event.
    pub fn snapshot(&self) -> Snapshot {
        let now = self.clock.now();
        let fault = match &self.state {
            State::Fault(fault) => Some(fault.clone()),
            _ => None,
        };
        let (error_code, error) = match (&fault, &self.failure) {
            (Some(fault), _) => (fault.code, Some(fault.cause.clone())),
            (None, Some(failure)) => (failure.code, Some(failure.words.clone())),
            (None, None) => (0, None),
        };
        let load = match &self.state {
            State::Loading { progress, .. } => Some(progress.clone()),
            _ => None,
        };
        let teach = match &self.state {
            State::Teaching { progress, .. } => Some(progress.clone()),
            _ => None,
        };
        let warnings = self.warnings();
        let (state, state_word) = self.state.named();
        Snapshot {
            at: now,
            state,
            state_word,
            status: self.status(warnings, error_code),
            warnings,
            heartbeat: self.worker.heartbeat,
            worker_alive: self.worker_is_in_time(),
            error_code,
            error,
            fault,
            control: ControlRegisters {
                // BUFFERED shows the mode that holds, also after a write without the bit.
                control: self.plc.registers.control
                    | self.results.buffered.map_or(0, |_| control::BUFFERED),
                ..self.plc.registers
            },
            recipe: self.recipes.active.clone(),
            requested_recipe: self.recipes.requested,
            recipe_result: self.recipes.result,
            triggers: self.requests.triggers,
            result_seq: self.results.last_seq,
            missed: self.requests.missed,
            last_token: self.requests.last_token,
            request: self
                .state
                .cycle()
                .and_then(|cycle| cycle.order.request.clone()),
            buffered: u16::try_from(self.results.queue.len()).unwrap_or(u16::MAX),
            reject_reason: self.requests.reject_reason,
            refusal: self.refusal(),
            uptime_s: now.seconds(),
            boot_id: self.settings.boot_id,
            identity: self.settings.identity.clone(),
            counts: self.results.counts,
            result: self.results.latest.clone(),
            oldest: self.results.queue.front().cloned(),
            load,
            teach,
            health: self.health.clone(),
        }
    }

    /// WARNING: the worker's bits, except those that the station decides.
    fn warnings(&self) -> u16 {
        let own = warning::PLC_LOST | warning::CLOCK_UNSYNCED;
        let of_worker = self.condition.warnings & !own & (0x00FF | warning::UNSTEADY_LIGHT);
        let now = self.clock.now();
        let storage = self.results.unstored || self.history_fails || self.health.storage_is_low();
        of_worker
            | word([
                (
                    warning::PLC_LOST,
                    self.plc.is_lost(self.settings.limits.plc, now),
                ),
                (warning::CLOCK_UNSYNCED, self.clock.utc_us(now).is_none()),
                (warning::STORAGE, storage),
                (warning::TEMPERATURE, self.health.is_hot()),
                (warning::POWER, self.health.lacks_power()),
                (warning::GEOMETRY, self.health.has_drifted()),
            ])
    }

    /// Why a trigger would be rejected now, as REJECT_REASON; `None` exactly while READY.
    pub(super) fn refusal(&self) -> Option<u16> {
        Some(match self.state {
            _ if !self.plc.holds(control::ONLINE) => reject::OFFLINE,
            State::Fault(_) => reject::FAULT,
            State::Ready if self.recipes.active.is_none() => reject::NO_RECIPE,
            State::Ready if self.results.unstored => reject::FAULT,
            State::Ready if self.recipes.is_other_asked_for(&self.plc.registers) => {
                reject::OTHER_RECIPE
            }
            State::Ready => return None,
            _ => reject::NOT_READY,
        })
    }

    fn status(&self, warnings: u16, error_code: u16) -> u16 {
        let (state, results) = (&self.state, &self.results);
        let up = !matches!(state, State::Boot { .. } | State::Stopping { .. });
        word([
            (status::ONLINE, up && self.plc.holds(control::ONLINE)),
            (status::READY, self.refusal().is_none()),
            (status::BUSY, matches!(state, State::Acquiring { .. })),
            (
                status::PROCESSING,
                matches!(state, State::Processing { .. }),
            ),
            (status::EXPOSURE_DONE, results.exposure_done),
            (status::RESULT_VALID, results.valid),
            (status::RESULT_TOGGLE, results.toggle),
            (status::TRIGGER_ACK, self.plc.holds(control::TRIGGER)),
            (
                status::RECIPE_LOADING,
                matches!(state, State::Loading { .. }),
            ),
            (status::RECIPE_OK, self.recipes.is_ok()),
            (status::WARNING, warnings != 0),
            (status::ERROR, error_code != 0),
            (status::MISSED_TRIGGER, self.requests.missed_latch),
            (status::BUFFER_OVERFLOW, results.overflow_latch),
            (status::WARMING_UP, self.condition.warming_up),
            (status::CALIBRATION_VALID, self.condition.calibration_valid),
        ])
    }
}

/// The word with the bits that are set.
fn word<const N: usize>(bits: [(u16, bool); N]) -> u16 {
    let set = bits.into_iter().filter(|(_, set)| *set);
    set.fold(0, |word, (bit, _)| word | bit)
}

impl Snapshot {
    /// Why a trigger would be rejected now, in words with the remedy; `None` exactly while READY.
    pub fn refusal_words(&self) -> Option<String> {
        Some(match (self.refusal?, &self.fault, &self.recipe) {
            (reject::OFFLINE, ..) => {
                "offline: the PLC does not ask for ONLINE; it sets CONTROL bit 0".into()
            }
            (reject::NO_RECIPE, ..) if !self.is(status::CALIBRATION_VALID) => {
                "the head is not calibrated: commission it on the page, under Head, or run `fringed calibrate`".into()
            }
            (reject::NO_RECIPE, ..) => "no recipe is active: load or teach one".into(),
            (reject::FAULT, Some(fault), _) => {
                format!("fault {}: {}; {}", fault.code, fault.cause, fault.remedy)
            }
            (reject::FAULT, None, _) => {
                "the number of the last result is not stored yet: it is tried every second".into()
            }
            (reject::OTHER_RECIPE, _, Some(active)) => self.other_recipe(active),
            _ => format!(
                "the station is in state {}: try again when it is ready",
                self.state_word
            ),
        })
    }

    /// Which recipe was asked for while `active` is active, and the remedy.
    fn other_recipe(&self, active: &ActiveRecipe) -> String {
        let number = active.number;
        match (self.recipe_result, self.control.recipe_select) {
            (RecipeResult::Ok, BY_PART_NUMBER) => format!(
                "the PLC selects part number {:?}, recipe {number} for {:?} is active: load the recipe of that part",
                self.control.part_number_text(),
                active.part_number
            ),
            (RecipeResult::Ok, select) => format!(
                "the PLC selects recipe {select}, recipe {number} is active: load recipe {select}, or have the PLC write \
                 {number} or 0 to RECIPE_SELECT"
            ),
            (failed, _) => {
                let asked = match self.requested_recipe {
                    BY_PART_NUMBER => "the recipe of the PLC's PART_NUMBER".into(),
                    requested => format!("recipe {requested}"),
                };
                let other = match self.requested_recipe == number {
                    true => String::new(),
                    false => format!(", or recipe {number} to go on with that one"),
                };
                let why = failed.words();
                format!("{asked} could not be loaded: {why}; load it{other}")
            }
        }
    }
}
