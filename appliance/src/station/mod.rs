//! The station: the pure state machine that decides, and the snapshot that it publishes.
//!
//! [`step()`] is a function `(station, event, now) → (station, effects)`. It knows no thread, no
//! socket and no clock: time is an argument ([`Micros`]), the worker and the PLC are [`Event`]s,
//! and everything it wants done is an [`Effect`]. Its registers follow `docs/modbus.md`, version
//! 1.3. Modbus and the page see nothing but one immutable [`Snapshot`]. [`StationHandle`] is the
//! one place where the machine meets a clock, a mutex and channels.
//!
//! [`machine`] holds the parts: clock, PLC, triggers, recipes, worker, results. Each part is changed
//! only by its own functions. [`mod@step`] takes a write of the PLC itself and sends other events to
//! the transition that takes them: `cycle` (trigger to result), `change` (load and teach), `watch`
//! (faults).
//!
//! Decisions where the register map is silent:
//!
//! - **Every accepted trigger ends in exactly one result.** A measurement that failed, was aborted
//!   or ran into its deadline gives a result with verdict INVALID and the cause in its ERROR_CODE;
//!   results since the start = TRIGGERS − cycles in flight.
//! - **RECIPE_LOAD beats TRIGGER in one write**: the load begins, the trigger is rejected as not
//!   ready. Measuring the new part with the old recipe could pass the wrong part. With
//!   RECIPE_SELECT 0 nothing is loaded and the trigger counts.
//! - **A part is measured only with the recipe that was asked for.** Every trigger, from the PLC or
//!   the page, is rejected with reason 6 while the RECIPE_SELECT that is held in CONTROL names
//!   another recipe than the active one, and after a load that failed until one succeeds. READY is
//!   then 0, so it always says whether a trigger would be accepted.
//! - The bits of one CONTROL write act in this order: ERROR_RESET, ABORT, ONLINE, RESULT_ACK,
//!   BUFFERED, RECIPE_LOAD, TEACH, TRIGGER. So one write can clear a fault and trigger. An abort
//!   takes effect when the worker answers; until then the station is busy.
//! - A trigger by edge answers with TOKEN 0 unless the same write brings a new token. LAST_TOKEN
//!   changes only by a token.
//! - RECIPE_OK means that the requested recipe is the active one: a failed load keeps the old
//!   recipe and clears the bit; no trigger is accepted without it. Loading the recipe that is still
//!   active sets it again.
//! - A load that the page asks for while the station is busy is refused and changes nothing. A load
//!   that the PLC asks for then counts as one that failed, because the PLC may trigger without
//!   looking at the answer.
//! - TEACH with RECIPE_SELECT 0 or 65535 replaces the active recipe, so it is rejected where a
//!   trigger would be with reason 6.
//! - ERROR and ERROR_CODE show a fault, else the last failed cycle until a cycle succeeds or
//!   ERROR_RESET.
//! - EXPOSURE_DONE also rises with the result of a cycle whose exposure was never reported: the
//!   head is idle, the part may move.
//! - The PLC's heartbeat is watched from its first change on; a PLC that never uses it is never
//!   reported lost.
//! - A fault of a lost device, of storage and of a worker's silence outside of a cycle clears by
//!   itself when its cause is gone; a load or teach in which the worker was silent goes on then, and
//!   the recipe before stays active until it ends. Only the fault of a cycle that missed its
//!   deadline, or of a start, waits for ERROR_RESET.
//! - A lost device ends the cycle in flight as INVALID. After its recovery the active recipe is the
//!   one that the worker still holds. A load or teach that the loss interrupted counts as a load
//!   that failed.
//! - Full storage is a fault only between two jobs: the cycle in flight still gets its result. A
//!   result whose SEQ could not be stored is shown, but no further trigger is accepted until that
//!   SEQ is stored.
//! - Of clients that trigger without a pause each is granted in turn; until then the one that was
//!   granted last is rejected as not ready, although READY is 1.
//! - REJECT_REASON stays until the next rejected request.

/// Declares the bits of a word: each once, with its name, its number and what people read while it is
/// set. Where each has words, `words` gives those of the bits that are set.
macro_rules! bits {
    ($($(#[$doc:meta])* $name:ident = $bit:literal;)*) => {
        $($(#[$doc])* pub const $name: u16 = 1 << $bit;)*

        /// The names of the bits in their order, from bit 0 on.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];
    };
    ($($(#[$doc:meta])* $name:ident = $bit:literal, $words:literal;)*) => {
        bits! { $($(#[$doc])* $name = $bit;)* }

        /// The words of the bits that are set.
        pub fn words(bits: u16) -> impl Iterator<Item = &'static str> {
            let all = [$(($name, $words)),*].into_iter();
            all.filter(move |(bit, _)| bits & bit != 0).map(|(_, words)| words)
        }
    };
}

pub mod clock;
pub mod control;
pub mod error_code;
pub mod event;
pub mod fault;
pub mod gauge;
pub mod handle;
pub mod health;
pub mod machine;
pub mod recipes;
pub mod result;
pub mod results;
pub mod snapshot;
pub mod stages;
pub mod state;
pub mod step;
pub mod triggers;

mod change;
mod cycle;
mod watch;

#[cfg(test)]
mod tests;

pub use algo::inspect::Marking;
pub use clock::Micros;
pub use control::{ConnectionEdges, ControlRegisters, ControlWrite, Masked, RefusedWrite};
pub use event::{
    Condition, Effect, Effects, Event, Job, JobId, PlcOrder, Request, Teaching, Unstored,
};
pub use fault::Fault;
pub use gauge::{COVERAGE_FACTOR, Decision, GaugeLimits, GaugeValue, Measured, Square, Unit};
pub use handle::{StationHandle, tick};
pub use health::{
    Drift, FULL_STORAGE_MIB, HOT_PROJECTOR_C, Health, Pace, Power, ProjectorHealth, System,
};
pub use machine::{Identity, Limits, Settings, Station};
pub use recipes::{ActiveRecipe, RecipeKey, RecipeResult};
pub use result::{
    Inspection, MAX_GAUGES, Placement, ResultRecord, Skipped, UnsteadyLight, Verdict,
};
pub use results::{Buffered, Counts, MAX_BUFFERED};
pub use snapshot::Snapshot;
pub use stages::{Stage, StageTime, Stages};
pub use state::{Cycle, LoadProgress, State, TeachProgress};
pub use step::step;
pub use triggers::{Client, Trigger};
