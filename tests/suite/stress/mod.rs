//! Numerical stability: what the decoder, the patterns and the geometry do at their limits.
//!
//! - [`stack`]: frames of any samples, decoded in every way at once; [`bounds`]: how far a result may
//!   be from the textbook's; [`random`]: seeded stacks of every form;
//!   [`rig`]: rigs to triangulate with; [`twins`]: a rig judged by the textbook.
//! - Each other module holds the promises of one threat; their bounds stand in `algo`'s README.

mod arctangent;
mod bounds;
mod calibrations;
mod extremes;
mod limits;
mod place;
mod random;
mod rays;
mod rig;
mod stack;
mod textbook;
mod twins;
mod wraps;
