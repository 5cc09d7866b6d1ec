//! What a measurement leaves behind for people: pictures, plots, clouds.

pub mod canvas;
pub mod cloud;
pub mod colour;
pub mod folder;
pub mod picture;
