//! Sections of features: the points of each, collected row by row, and gap and flush from them.
//!
//! Each measured pixel near a section becomes a point of the part as taught (`sight`), which is kept
//! if it lies within the section's width (`points`); after all strips the joint is found in them
//! ([`section`](crate::inspect::section), `find`). Nothing is resampled.

mod expected;
mod find;
mod points;
mod sight;

pub use expected::Sections;
pub use find::SectionFit;
pub use points::SectionPoints;
pub use sight::SectionSight;
