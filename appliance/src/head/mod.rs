//! The head as a measuring instrument: its calibration, what can be measured on it, and the doctor
//! that checks it.

pub mod board;
pub mod calibrate;
pub mod calibrated;
pub mod calibration;
pub mod capture;
pub mod channel;
pub mod code;
pub mod commission;
pub mod direction;
pub mod doctor;
pub mod empty;
pub mod examine;
pub mod exposing;
pub mod geometry;
pub mod live;
pub mod means;
pub mod placed;
pub mod rasters;
pub mod scale;
pub mod scan;
pub mod seam;
pub mod standing;

#[cfg(test)]
mod tests;
