//! What a measurement leaves behind for people: pictures, arrays, clouds, tables.
pub mod picture;
