//! What the station remembers between two events, its settings, and the few changes that several events share.

use std::sync::Arc;

use super::control::{self, ControlRegisters};
use super::event::{Condition, Effect, Effects, JobId, RecipeResult};
use super::health::Health;
use super::result::ResultRecord;
use super::snapshot::Identity;
use super::state::{ActiveRecipe, ClearedBy, Fault, Micros, State};

/// The most unacknowledged results in BUFFERED mode.
pub const MAX_BUFFERED: usize = 32;
/// The HEARTBEAT register advances once in this time.
pub const BEAT: Micros = Micros::from_millis(100);

/// The deadline of every wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The worker opens its head.
    pub boot: Micros,
    /// Trigger → exposure done.
    pub acquiring: Micros,
    /// Exposure done → result.
    pub processing: Micros,
    /// A recipe is loaded.
    pub loading: Micros,
    /// Teaching: from one sign of progress to the next.
    pub teaching: Micros,
    /// The worker's signs of life while it waits for orders.
    pub idle: Micros,
    /// The same, before its silence is a fault.
    pub silent: Micros,
    /// PLC_HEARTBEAT may stand still for this long.
    pub plc: Micros,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            boot: Micros::from_millis(30_000),
            acquiring: Micros::from_millis(10_000),
            processing: Micros::from_millis(10_000),
            loading: Micros::from_millis(10_000),
            teaching: Micros::from_millis(30_000),
            idle: Micros::from_millis(1_000),
            silent: Micros::from_millis(10_000),
            plc: Micros::from_millis(5_000),
        }
    }
}

/// What the station is told once, when it is made.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The SEQ of the next result: one more than the last that was stored.
    pub next_seq: u32,
    /// Random per start.
    pub boot_id: u32,
    /// Whether the PLC may teach.
    pub teach_allowed: bool,
    /// Who this device is.
    pub identity: Arc<Identity>,
    /// Deadlines.
    pub limits: Limits,
}

/// The station: plain values. [`super::step()`] is its only door.
#[derive(Debug, Clone)]
pub struct Station {
    pub(super) settings: Settings,
    pub(super) state: State,
    pub(super) control: ControlRegisters,
    pub(super) recipe: Option<ActiveRecipe>,
    pub(super) requested_recipe: u16,
    pub(super) recipe_result: RecipeResult,
    pub(super) triggers: u32,
    pub(super) missed: u32,
    pub(super) last_seq: u32,
    pub(super) last_token: u16,
    pub(super) last_job: JobId,
    pub(super) reject_reason: u16,
    pub(super) missed_latch: bool,
    pub(super) overflow_latch: bool,
    pub(super) exposure_done: bool,
    pub(super) result_valid: bool,
    pub(super) result_toggle: bool,
    pub(super) result: Option<Arc<ResultRecord>>,
    pub(super) queue: heapless::Deque<Arc<ResultRecord>, MAX_BUFFERED>,
    /// The last cycle's failure: its code and words.
    pub(super) failure: Option<(u16, Arc<str>)>,
    pub(super) condition: Condition,
    /// Whether the history cannot be written.
    pub(super) history_fails: bool,
    pub(super) health: Health,
    /// Whether the SEQ of the last result still has to be stored.
    pub(super) unstored: bool,
    pub(super) heartbeat: u16,
    pub(super) next_beat: Micros,
    pub(super) last_alive: Micros,
    /// The last change of PLC_HEARTBEAT; `None` until the PLC uses it.
    pub(super) plc_seen: Option<Micros>,
    /// µs since 1970 at the time zero of [`Micros`], while the clock is synchronised.
    pub(super) utc_at_zero: Option<u64>,
    /// The time of the last event.
    pub(super) now: Micros,
}

impl Station {
    /// A station that boots at `now`.
    pub fn new(settings: Settings, now: Micros) -> Self {
        Self {
            state: State::Boot {
                deadline: now.after(settings.limits.boot),
            },
            control: ControlRegisters::default(),
            recipe: None,
            requested_recipe: 0,
            recipe_result: RecipeResult::Ok,
            triggers: 0,
            missed: 0,
            last_seq: settings.next_seq.wrapping_sub(1),
            last_token: 0,
            last_job: JobId(0),
            reject_reason: 0,
            missed_latch: false,
            overflow_latch: false,
            exposure_done: false,
            result_valid: false,
            result_toggle: false,
            result: None,
            queue: heapless::Deque::new(),
            failure: None,
            condition: Condition::default(),
            history_fails: false,
            health: Health::default(),
            unstored: false,
            heartbeat: 0,
            next_beat: now.after(BEAT),
            last_alive: now,
            plc_seen: None,
            utc_at_zero: None,
            now,
            settings,
        }
    }

    /// What the station is doing.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Whether the PLC asks for ONLINE.
    pub(super) fn wants_online(&self) -> bool {
        self.control.control & control::ONLINE != 0
    }

    /// The state between two jobs.
    pub(super) fn rest(&self) -> State {
        if self.wants_online() {
            State::Ready
        } else {
            State::Offline
        }
    }

    /// Whether the worker meets its deadlines: that of the wait it is in, else a sign of life now and then.
    pub(super) fn worker_meets_deadlines(&self, now: Micros) -> bool {
        match self.state.deadline() {
            Some(deadline) => now <= deadline,
            None => now.since(self.last_alive) <= self.settings.limits.idle,
        }
    }

    /// Whether the PLC's heartbeat stands still.
    pub(super) fn plc_is_lost(&self, now: Micros) -> bool {
        self.plc_seen
            .is_some_and(|seen| now.since(seen) > self.settings.limits.plc)
    }

    pub(super) fn next_job(&mut self) -> JobId {
        self.last_job = JobId(self.last_job.0.wrapping_add(1));
        self.last_job
    }

    /// The fault of a worker that did not answer in time.
    pub(super) fn deadline_fault(&self, waiting_for: &str, limit: Micros, now: Micros) -> Fault {
        Fault {
            code: super::error_code::DEADLINE,
            cause: format!("the measuring task was given {} ms to {waiting_for} and did not answer", limit.0 / 1000).into(),
            remedy: "wait until the heartbeat runs again, then set ERROR_RESET; if it stays still, restart fringed".into(),
            since: now,
            cleared_by: ClearedBy::SignOfLife,
        }
    }
}

/// Queues an effect.
pub(super) fn push(effects: &mut Effects, effect: Effect) {
    // One event causes far fewer than the capacity; the random walk test holds that nothing is ever dropped here.
    let pushed = effects.push(effect);
    debug_assert!(
        pushed.is_ok(),
        "more than {} effects of one event",
        super::event::MAX_EFFECTS
    );
}

/// Queues a line for the log.
pub(super) fn log(effects: &mut Effects, line: impl Into<Arc<str>>) {
    push(effects, Effect::Log(line.into()));
}
