//! Output of a measurement for people: pictures and point clouds.

pub mod board;
pub mod canvas;
pub mod cloud;
pub mod colour;
pub mod picture;
pub mod residuals;
