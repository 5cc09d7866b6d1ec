//! Numerical stability of the decoder, the patterns and the geometry at their limits.
//!
//! - [`stack`]: frames of any samples, decoded in every way; [`bounds`]: the largest difference
//!   from the textbook; [`random`]: seeded stacks of every form; [`rig`]: rigs for triangulation;
//!   [`twins`]: a rig that is compared with the textbook.
//! - Each other module tests one kind of limit; [`bounds`] has what each rounding adds.

mod arctangent;
mod bounds;
mod calibrations;
mod extremes;
mod highlights;
mod limits;
mod place;
mod random;
mod rays;
mod rig;
mod stack;
mod textbook;
mod twins;
mod wraps;
