//! Lines of the kernel's GPIO chips: the camera's trigger, the start line, and busy, ok and fault.
//!
//! A line is found by the label of its chip and its own name (`gpioinfo` lists both), because the
//! numbers of chips change with the kernel. Version 1 of the kernel's interface is used.
//!
//! In this version the kernel stamps edges on `CLOCK_MONOTONIC` (since Linux 5.7), queues 16 of
//! them, drops further ones without notice, and does not debounce. So
//! [`Debounce`](crate::lines::Debounce) debounces here, and reads the level at the end.
//!
//! A line is left at its idle level when its owner is dropped, also by a panic. After a kill it
//! depends on the driver of the chip. Raspberry Pi kernels keep the line an output at its last
//! level (`persist_gpio_outputs`, on unless `dtparam=strict_gpiod` is set); otherwise it becomes an
//! input, and a resistor has to hold its level. [`leave_idle`] puts such lines back at their idle
//! levels.

mod chip;
mod failure;
mod output;
mod pulse;
mod start;

pub use failure::LineError;
pub use output::{Output, leave_idle};
pub use pulse::Pulse;
pub use start::Start;

/// What the kernel shows as the user of a line.
const CONSUMER: &str = "fringed";
