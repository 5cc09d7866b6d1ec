//! The head as a measuring instrument: its calibration, what can be measured on it, and the doctor
//! that checks it.

pub mod board;
pub mod calibrated;
pub mod calibration;
pub mod channel;
pub mod code;
pub mod commission;
pub mod direction;
pub mod doctor;
pub mod examine;
pub mod exposing;
pub mod geometry;
pub mod live;
pub mod placed;
pub mod rasters;
pub mod scan;
pub mod seam;

#[cfg(test)]
mod tests;
