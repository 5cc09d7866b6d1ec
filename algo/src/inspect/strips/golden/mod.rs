//! The golden part as the camera sees it, and what it lies on: what all stages count heights from
//! and compare with.

mod ground;
mod near;
mod part;

pub use near::{Near, NodeRow};
pub use part::{Golden, base_nm};
