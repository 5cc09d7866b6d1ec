//! Sections: gap and flush of a joint of two sheets with rounded edges.
//!
//! # Idea
//! Of an edge that turns away from the camera the extreme point is never seen, and the heights next
//! to the rim are wrong by hundreds of µm, because blur mixes phases there. Both ends of a gap are
//! therefore extrapolated from geometry: each side is a line through its flat stretch and a circle
//! tangent to it through what is seen of its edge.
//!
//! # Definitions
//! Flush is the distance of the right tangent point from the left line, gap the distance of the
//! circles' extreme points along the mean direction of both lines.
//!
//! # Stages
//! `find` sorts points in one pass, `line` fits a stretch, `bins` averages what lies between both;
//! `rough` has the first circle of an edge by `circle`, through how `profile` says that pixels see
//! it; after a second pass, without points that are off both circles, `edge` has it with its
//! covariance. `geometry` has gap, flush and radius, and `inputs` their uncertainty. `request` says
//! why a section is not measured.
//!
//! # Accuracy
//! `tests/measured.rs`: radii of 1 to 2 mm, gaps of 2 to 6 mm, at 0.145 mm per px and, where the
//! radius is stated, at 0.41. Without it a circle is refused there: blur makes several look alike.
//!
//! # Cost
//! Two passes over the points, and for each side some 50 evaluations of each bin of its arc (test
//! `cost`).
//!
//! # Units
//! mm along the section (s) and of height (z), mm², rad.

mod bins;
mod circle;
mod edge;
mod find;
mod geometry;
mod inputs;
mod line;
mod profile;
mod request;
mod rough;

pub use edge::RoundEdge;
pub use find::Section;
pub use geometry::{Joint, Pair, Round, flush, gap, radius};
pub use inputs::{JointInput, JointSource, JointValue, Knowledge};
pub use request::{Optics, Request, SectionPoint, Side, Unseen, Why};

#[cfg(test)]
mod tests;
