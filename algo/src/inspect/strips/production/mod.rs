//! The stages in their order: what they need is planned once ([`plan`]), strips of rows go through
//! them ([`strip`]), and a part is placed and inspected ([`inspection`]).

pub mod anchors;
pub mod by_openings;
pub mod drawn;
pub mod inspection;
pub mod plan;
pub mod rendered;
pub mod strip;

#[cfg(test)]
mod tests;
