//! The paper's experiments on the simulated head, with fixed, the paper's adaptive and the better
//! patterns (`fringed-lab experiment`).

mod campaign;
mod judge;
mod methods;
mod runner;
mod scenes;
mod table;

pub use campaign::{Campaign, Results};
pub use methods::{BetterSequence, Method, NoSequence};
pub use runner::{Run, Runner};
pub use scenes::{Judged, OpticsKind, PARTS, Scene};
pub use table::{HEADER, RunRow, Values, csv, means, table};
