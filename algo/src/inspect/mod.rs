//! What a height map says about a part: regions, gauges and the comparison with the golden map.

mod align;
pub mod contour;
mod feature;
mod gauge;
pub mod good;
mod highlights;
mod largest;
mod marking;
mod mask;
mod missed;
mod normal_shares;
mod openings;
mod region;
mod ripple;
pub mod section;
mod strips;
mod surroundings;
mod table;
mod taught;
mod weight;

pub use align::{Facet, Found, GoldenSurface, Motion, Picture, Placed};
pub use contour::State;
pub use feature::{Cut, Feature, FeatureKind, Geometry, TooFine};
pub use gauge::{
    Basis, Declared, Domain, Evidence, Facts, Kind, MAX_PLACES, Measure, Parameter, Reading,
    Square, Unit, Value, kinds, makes_datum,
};
pub use highlights::Highlights;
pub use largest::Largest;
pub use marking::{Marking, NoPart};
pub(crate) use mask::components;
pub use mask::eroded;
pub use missed::Missed;
pub use normal_shares::normal_shares;
pub use openings::{Opening, openings};
pub use region::{Region, RegionError, polygon_spans};
pub use ripple::ripple;
pub use strips::{
    CalibrationUncertainty, Drawing, Drawn, Findings, FoundFeature, Gauge, GoldenSignal, Input,
    Levels, Lost, MAX_FEATURES, MAX_GAUGES, Maps, Missing, PairBuffers, PairPlaced, Parts, Place,
    Production, Profile, SeenRim, Signal, Skipped, Strips, Unmeasurable,
};
pub use surroundings::{Surroundings, surroundings};
pub use taught::Taught;
pub use weight::{Factor, Weight};
