//! Recipes: everything that one part number needs, in one file.
//!
//! Each of these imports only from those before it:
//!
//! - [`mod@file`]: a recipe in its file, with the rules that it keeps, and its checked form
//!   [`Recipe`];
//! - [`shown`]: what is said and drawn of the features of a part;
//! - [`plan`]: a recipe joined with the head's calibration; parts, recordings and golden are judged
//!   by it;
//! - [`store`]: the files of a station, with previous generations, exports and imports;
//! - [`teach`]: measures a good part and makes a recipe that is known to hold, new or in place of
//!   another one;
//! - [`mod@edit`]: changes a stored recipe, and tries a change before it is stored.

pub mod edit;
pub mod file;
pub mod plan;
pub mod shown;
pub mod store;
pub mod teach;

pub use file::archive::short;
pub use file::demands::Demands;
pub use file::feature::{DatumFile, FeatureFile};
pub use file::gauge::GaugeFile;
pub use file::recipe::{Conditions, Recipe, RecipeId, RecipeSequence};
pub use file::refusal::{Element, Part, Refusal};
pub use file::{
    AlignmentKind, PatternFile, RecipeFile, SequenceFile, SequenceKind, UnseenFile, safe,
};
pub use shown::FeatureView;
pub use store::{ChangeError, LoadError, Store};
