//! The paper's experiments on the simulated head, with fixed, the paper's adaptive and the better
//! patterns (`fringed experiment`).

mod methods;
mod scenes;

pub use methods::{Method, Outcome, Runner};
pub use scenes::{OpticsKind, PARTS, Scene};
