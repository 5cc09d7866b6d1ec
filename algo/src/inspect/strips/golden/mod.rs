//! The golden part as the camera sees it, and what it lies on: what all stages count heights from
//! and compare with.

pub mod ground;
pub mod near;
pub mod part;
