//! Stage 5, gauge: the contours of features, each found in its plane after the planes are fitted.
//!
//! What [`contour`](crate::inspect::contour) needs of a part is filled in here: where a contour is
//! expected is known from golden (`taught`, which begins with the outline of the opening in golden's
//! heights, `trace`), how the camera sees its plane follows from the models and from how the part
//! lies (`face`), and the demodulated light comes from the frames (`light`). `find` joins them.
//!
//! Each contour is found by one thread, so the bits do not depend on the number of threads.

pub mod face;
pub mod find;
pub mod light;
pub mod taught;
pub mod trace;

pub use find::{ContourFit, FoundFeature, Lost, SeenRim, moved};
pub use light::{GoldenSignal, Levels, Signal};
pub use taught::{Contours, ExpectedContour, Known, REACH_MM};
