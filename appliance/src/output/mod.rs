//! What a measurement leaves behind for people: arrays, pictures, clouds.

pub mod array;
pub mod cloud;
pub mod colour;
pub mod folder;
pub mod picture;
