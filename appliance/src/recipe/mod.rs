//! Recipes: everything that one part number needs, in one file.
//!
//! - On disk: [`mod@file`] is the manifest, [`feature`] its features and datum systems, `gauge` and
//!   `gauge_keys` its gauges, [`kinds`] the table of what they can measure, `forms` what a form for
//!   features and limits needs, [`tolerance`] and `gauge_limits` what their limits come from,
//!   `references` which features they name, [`bounds`] the bounds of lists and of values that depend
//!   on others, [`archive`] the ZIP with its fingerprint, [`models`] the head that it was taught
//!   with, [`gauges_toml`] features, datum systems and gauges as text for people.
//! - Checked: [`check`] turns manifest and arrays into a [`Recipe`], `judging` refuses what cannot
//!   judge, [`plan`] joins that with the head's calibration; `light` tells bad light from bad
//!   parts, `recorded` finds the recipe's pattern in a recording,
//!   `outline` names what was measured.
//! - Stored: [`store`] keeps the files of a station, [`generations`] previous generations and
//!   deleted recipes, [`incoming`] files that are being uploaded; [`exchange`] lists, exports and
//!   imports, [`edit`] changes, `differences` says what was changed.
//! - Made: [`teach`] measures the part, `illumination` chooses its light, [`adaptive`] makes its
//!   pattern, [`captures`] measures the part with this pattern by every sequence that production
//!   may use (`candidates`), [`golden`] makes the recipe, [`planner`] chooses the sequence,
//!   [`good_parts`] squares and limit of the deviation, `sides` those squares from place to place,
//!   `limits` sets and `proof` tries the limits of all gauges, `signal` is golden's light as it was
//!   demodulated; [`replace`] keeps names and gauges of a recipe that is taught again, `regauge`
//!   works out limits that follow golden.
//! - Shown: `outline` says what became of the features of a part, `lost` why one was not found,
//!   `drawn` what is drawn of it; [`trying`] measures an edit before it is stored, `wrong` names all
//!   that is wrong with it.

pub mod adaptive;
pub mod archive;
mod candidates;
pub mod captures;
pub mod check;
pub mod comparison;
mod demands;
mod differences;
mod drawn;
pub mod edit;
pub mod exchange;
mod failure;
pub mod feature;
pub mod file;
mod gauge;
mod gauge_keys;
mod gauge_limits;
pub mod gauges_toml;
pub mod generations;
pub mod golden;
pub mod good_parts;
mod illumination;
pub mod incoming;
pub mod kinds;
mod light;
mod limits;
mod lost;
mod median;
pub mod models;
mod outline;
pub mod part_seen;
pub mod plan;
pub mod planner;
mod proof;
mod recorded;
mod refusal;
mod regauge;
pub mod replace;
mod rounds;
pub mod rules;
mod shots;
mod sides;
pub mod store;
pub mod surroundings;
pub mod teach;
pub mod tolerance;
pub mod trying;

pub use archive::short;
pub use check::{Conditions, Recipe, RecipeId, RecipeSequence};
pub use demands::Demands;
pub use feature::{DatumFile, FeatureFile};
pub use file::{
    AlignmentKind, PatternFile, RecipeFile, SequenceFile, SequenceKind, UnseenFile, safe,
};
pub use gauge::GaugeFile;
pub use outline::{Outline, Seen};
pub use rules::{Element, Part, Refusal};
pub use store::{ChangeError, LoadError, Store};
