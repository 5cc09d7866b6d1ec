//! Stage 5, gauge: the contours of features, each found in its plane after the planes are fitted.
//!
//! What [`contour`](crate::inspect::contour) needs of a part is filled in here: where a contour is
//! expected is known from golden (`taught`, which begins with the outline of the opening in golden's
//! heights, `trace`), how the camera sees its plane follows from the models and from how the part
//! lies (`face`), and the demodulated light comes from the frames (`light`). `find` joins them.
//!
//! Each contour is found by one thread, so the bits do not depend on the number of threads.

mod anchors;
mod face;
mod find;
mod light;
mod taught;
mod trace;

pub use anchors::{Anchors, LEAST, MOST, anchors};
pub use find::{ContourFit, FoundFeature, Lost, SeenRim, moved};
pub use light::{GoldenSignal, Levels, Signal};
pub use taught::{Contours, Expected, Known, REACH_MM};
