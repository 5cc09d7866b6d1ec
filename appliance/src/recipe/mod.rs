//! Recipes: everything that one part number needs, in one file.
//!
//! `file` is the form on disk, `bounds` what its values may be, `archive` the ZIP around it with its fingerprint, `check` turns the
//! one into a [`Recipe`] that can be planned, `gauge` says what its gauges measure, `store` keeps the files of a station,
//! `arriving` those on their way into it, `generations` those before the newest, `replace` what stays of a recipe that is
//! taught again.

pub mod archive;
pub mod arriving;
pub mod bounds;
pub mod check;
pub mod comparison;
mod demands;
pub mod edit;
pub mod exchange;
pub mod file;
mod gauge;
pub mod generations;
pub mod golden;
pub mod good_parts;
pub mod plan;
pub mod planner;
pub mod replace;
pub mod store;
pub mod teach;

pub use archive::short;
pub use check::{Conditions, Recipe, RecipeId, RecipeSequence};
pub use demands::Demands;
pub use file::{
    AlignmentKind, AxisFile, ComponentFile, GaugeFile, GaugeKind, PatternFile, RecipeFile,
    RegionFile, SequenceFile, SequenceKind, safe,
};
pub use store::{LoadError, Store};
