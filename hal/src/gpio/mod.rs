//! Lines of the kernel's GPIO chips: the camera's trigger, the start line, and busy, ok and fault.
//!
//! A line is found by the label of its chip and its own name (`gpioinfo` lists both), because the numbers of chips change with
//! the kernel. It is spoken to through version 1 of the kernel's interface.
//!
//! What that version can promise: edges are stamped by the kernel on `CLOCK_MONOTONIC` (since Linux 5.7); 16 of them are queued, and what
//! comes on top is lost without a sign; the kernel does not debounce. So [`Debounce`](crate::lines::Debounce) does it here and looks at
//! the level in the end.
//!
//! A line is left at its idle level when its owner is dropped, also by a panic. A process that is killed cannot do that: then
//! the kernel turns the line into an input, and a resistor has to hold it.

mod chip;
mod failure;
mod output;
mod pulse;
mod start;

pub use failure::LineError;
pub use output::Output;
pub use pulse::Pulse;
pub use start::Start;

/// What the kernel shows as the user of a line.
const CONSUMER: &str = "fringed";
