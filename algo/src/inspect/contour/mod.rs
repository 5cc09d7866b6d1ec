//! Contours: where a face ends, in the plane of the face.
//!
//! # Idea
//! Heights near a rim are wrong, because blur mixes phases there, and brightness depends on what
//! lies behind. But demodulated light is linear in what a pixel sees. Light that is in phase with
//! the plane of the face is material; where it ends is the contour.
//!
//! ```text
//! Z = B e^{2πiφ}    w = Z e^{−2πi r Φ̂}    w = b · material + a · background
//! ```
//!
//! with Φ̂ the phase that the plane has at the pixel, b and a complex and constant along a piece of
//! about two pixels.
//!
//! # Stages
//! `start` finds the contour to a tenth of a pixel on some of its normals. `piece` divides it and
//! gathers the pixels of each piece, whose levels `sample` demodulates and adds. `fit` finds the
//! edge of each piece by the profile of `edge` and what `beyond` knows of walls and floors,
//! [`associate`](crate::math::solve) the shape through the edges, `find` does this with some of
//! the pieces until nothing moves and with all of them in the end, and `verdict` says whether the
//! contour is found, absent or unseen. `inputs` states what else is uncertain.
//!
//! # Units
//! mm in the plane's frame, px in the picture, turns, counts.

mod beyond;
mod edge;
mod find;
mod fit;
mod inputs;
mod piece;
mod ring;
mod sample;
pub mod shape;
mod start;
mod verdict;
mod view;

pub use crate::math::solve::Point;
pub use find::{Contour, find};
pub use inputs::{Input, PIECE_PX, Source, inputs};
pub use verdict::{Outcome, State};
pub use view::{Fringes, Setup, Spot, View};

#[cfg(test)]
mod tests;
