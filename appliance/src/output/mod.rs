//! What a measurement leaves behind for people: pictures and clouds, each file whole.

pub mod canvas;
pub mod cloud;
pub mod colour;
pub mod picture;
