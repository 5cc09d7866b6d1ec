//! How a part lies in front of a simulated head.

use hal::bounded;
use hal::bounds::{MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG};

bounded! {
    /// How a part lies: rotated about x, then y (tilt), then z (rotation), then shifted.
    #[derive(Copy)]
    pub struct Placement: Default {
        /// Shift x, y, z in mm.
        pub shift_mm: [f64; 3] = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM,
        /// Tilt about x and about y, degrees.
        pub tilt_deg: [f64; 2] = -MAX_TILT_DEG..=MAX_TILT_DEG,
        /// Rotation about z, degrees.
        pub rotation_deg: f64 = -MAX_ROTATION_DEG..=MAX_ROTATION_DEG,
    }
}
