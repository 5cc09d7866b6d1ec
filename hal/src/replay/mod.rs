//! The replay back-end: recordings in format 1 are read, written, and played as a head.

mod check;
mod entries;
pub mod failure;
mod grey;
mod manifest;
mod play;
pub mod recorder;
pub mod recording;

pub use failure::RecordingError;
pub use play::head;
pub use recording::Recording;

#[cfg(test)]
mod tests;
