//! The live picture: what is shown for it, and what a picture says of light and sharpness.

mod figures;
mod patterns;
mod picture;
mod volume;

pub use figures::{Figures, Fringes};
pub use patterns::{Show, rasters};
pub use picture::Picture;
pub use volume::{Outline, outlines};
