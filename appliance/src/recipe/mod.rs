//! Recipes: everything that one part number needs, in one file.
//!
//! `file` is the form on disk, `archive` the ZIP around it with its fingerprint, `check` turns the
//! one into a [`Recipe`] that can be planned, `store` keeps the files of a station.

pub mod archive;
pub mod check;
pub mod comparison;
pub mod edit;
pub mod exchange;
pub mod file;
pub mod golden;
pub mod planner;
pub mod store;
pub mod teach;

pub use archive::short;
pub use check::Recipe;
pub use file::{
    GaugeFile, GaugeKind, PatternFile, RecipeFile, RegionFile, SequenceFile, SequenceKind, safe,
};
pub use store::{LoadError, Store};
