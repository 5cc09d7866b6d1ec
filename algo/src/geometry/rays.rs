//! The directions of a camera's whole pixels, worked out once.
//!
//! Each direction takes some iterations of [`Lens::undistorted`](super::Lens::undistorted), and
//! teaching asks for those of the same pixels dozens of times. A direction takes 16 bytes, so they
//! are only known while a recipe is taught or planned.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

/// The directions (x, y, 1) of whole pixels, row-major; empty where they are not known. Clones
/// share them.
#[derive(Clone, Default)]
pub(super) struct Rays(Arc<[(f64, f64)]>);

impl Rays {
    pub fn new(directions: Vec<(f64, f64)>) -> Self {
        Self(directions.into())
    }

    pub fn are_known(&self) -> bool {
        !self.0.is_empty()
    }

    /// The direction of a pixel of a frame of `width` columns, if it is a whole one and known.
    #[inline]
    pub fn at(&self, u: f64, v: f64, width: usize) -> Option<(f64, f64)> {
        // Casts keep to the range of their type.
        let (column, row) = (u as usize, v as usize);
        // No row of theirs is beyond their number.
        let inside = column < width && row < self.0.len();
        let whole = inside && column as f64 == u && row as f64 == v;
        let at = whole.then(|| row * width + column)?;
        let known = self.0.get(at).copied();
        known.filter(|(x, _)| !x.is_nan())
    }
}

/// What is known beforehand makes no other device.
impl PartialEq for Rays {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Rays {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{} rays", self.0.len())
    }
}
