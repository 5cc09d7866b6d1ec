//! What the operating system gives: clock, signals, sockets, priorities, memory, a service manager, and the log on stderr.

pub mod clock;
pub mod computing;
pub mod journal;
pub mod logbook;
pub mod memory;
pub mod notify;
pub mod priority;
pub mod progress;
pub mod socket;
pub mod told;
