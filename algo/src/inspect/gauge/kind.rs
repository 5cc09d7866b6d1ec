//! What a kind of gauge states of itself, and what it works out its value from.
//!
//! σ of a value follows from that of its pixels and of the motion: here for values that are linear
//! in heights, in `propagate.rs` for functions of planes, in `extreme.rs`, `rms_deviation.rs` and
//! `out_of_tolerance.rs` for theirs. The systematic part of U is in `strips/readings/uncertainty.rs`, guard
//! bands in the daemon's `station/gauge.rs`.

use super::extreme::motion;
use crate::inspect::align::Placed;
use crate::inspect::section;

pub(super) use super::extreme::range_of;
pub(super) use super::parameter::{Domain, Parameter, Value, words};
pub(super) use super::reading::{FoundValue, OfRim};
pub(super) use super::unit::Unit;
pub(super) use crate::inspect::feature::FeatureKind::{
    Circle, Line, Plane, Section, Slot, Surface,
};
pub(super) use crate::inspect::feature::{Cell, FeatureKind, Geometry, Rim};
pub(super) use alloc::vec::Vec;

/// Most features of a gauge.
pub const MAX_PLACES: usize = 2;

words! {
    /// A component of a part's motion, in the order of
    /// [`Placed::component`](crate::inspect::Placed::component).
    Component {
        /// Translation along x, mm.
        X: "x",
        /// Translation along y, mm.
        Y: "y",
        /// Translation along z, mm.
        Z: "z",
        /// Rotation about x, degrees.
        AboutX: "about_x",
        /// Rotation about y, degrees.
        AboutY: "about_y",
        /// Rotation about z, degrees.
        AboutZ: "about_z",
    }
}

/// What a value is worked out from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// The mean deviations of the squares of so many pixels a side about every pixel: odd, so that
    /// a square has a middle pixel.
    Squares(usize),
    /// Cells of so many pixels a side.
    Cells(usize),
    /// Cells whose side the grid chooses: the value hardly depends on it.
    Region,
    /// How many pixels have a height.
    Pixels,
    /// The part's motion; there is no region.
    Motion(Component),
    /// The geometry of its features ([`Kind::value`]); its error is propagated numerically.
    Geometry,
    /// The points of a contour ([`Kind::of_rim`]).
    Rim,
    /// A joint that a section crosses ([`Kind::of_section`]).
    Section,
}

impl Basis {
    /// The side of the squares or cells, if the gauge states one.
    pub fn side(self) -> Option<usize> {
        match self {
            Self::Squares(side) | Self::Cells(side) => Some(side),
            _ => None,
        }
    }

    /// The side of the squares.
    pub fn square_side(self) -> Option<usize> {
        match self {
            Self::Squares(side) => Some(side),
            _ => None,
        }
    }

    /// The side of the cells, if the value is worked out from cells; 0 if the grid may choose it.
    pub(in crate::inspect) fn cell_side(self) -> Option<usize> {
        match self {
            Self::Cells(side) => Some(side.max(1)),
            Self::Region => Some(0),
            _ => None,
        }
    }
}

/// Of which kinds the features of a gauge are: for each of its places, those that fit.
pub type Takes = &'static [&'static [FeatureKind]];

/// One surface.
pub(super) const SURFACE: Takes = &[&[Surface]];
/// A surface, or the face of a plane.
pub(super) const FACE: Takes = &[&[Surface, Plane]];
/// A surface, and a second one.
pub(super) const SURFACES: Takes = &[&[Surface], &[Surface]];
/// A round hole.
pub(super) const CIRCLE: Takes = &[&[Circle]];
/// A slot.
pub(super) const SLOT: Takes = &[&[Slot]];
/// A straight edge.
pub(super) const LINE: Takes = &[&[Line]];
/// A hole or slot.
pub(super) const OPENING: Takes = &[FeatureKind::OPENINGS];
/// A contour of any shape.
pub(super) const CONTOUR: Takes = &[FeatureKind::CONTOURS];
/// A section.
pub(super) const SECTION: Takes = &[&[Section]];
/// Two features with a geometry, of which some pairs fit ([`Kind::value`]).
pub(super) const FEATURES: Takes = &[FeatureKind::GEOMETRIC; 2];

/// What a gauge says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts {
    /// The unit of its value and limits.
    pub unit: Unit,
    /// What its value is worked out from.
    pub basis: Basis,
    /// The kinds of its features, place by place; empty where it is of the whole part.
    pub takes: Takes,
    /// What its fields say, in words behind the kind's name; each name of a field in braces stands
    /// for its value.
    pub words: &'static str,
    /// Whether its value may be that in a datum system.
    pub datum: bool,
    /// Whether its value is made of deviations from golden along its normal, and not of heights.
    pub compares: bool,
    /// Whether no part can have a value below 0, which the unit does not say.
    pub never_negative: bool,
    /// The deviation or height that the noise of a square or cell must stay below; without it, the
    /// gauge's limits are taken.
    pub noise_limit: Option<f64>,
}

impl Facts {
    /// The facts of a length that is made of heights and may be negative, of a kind without fields.
    pub(super) fn new(basis: Basis, takes: Takes) -> Self {
        Self {
            unit: Unit::Length,
            basis,
            takes,
            words: "",
            datum: false,
            compares: false,
            never_negative: false,
            noise_limit: None,
        }
    }

    /// Pixels around its region that it needs, where its squares have at least `widest` pixels a
    /// side.
    pub fn margin_px(&self, widest: usize) -> usize {
        let side = self.basis.square_side();
        side.map_or(0, |side| side.max(widest) / 2)
    }
}

/// What the declaration of a kind says of it.
pub trait Declared {
    /// What it measures, in words.
    fn about(&self) -> &'static str;

    /// Its parameters, in the order in which it declares them.
    fn parameters(&self) -> Vec<Parameter>;
}

/// A kind of gauge, with the values of its fields.
pub trait Kind: Declared {
    /// What it says of itself.
    fn facts(&self) -> Facts;

    /// The value of a gauge as a function of the geometry of its features, of which there are as
    /// many as it takes; `None` for other gauges, and where it does not measure such a pair.
    fn value(&self, _: &[Geometry]) -> Option<f64> {
        None
    }

    /// The value of a gauge of the points of a contour; `None` for other gauges.
    fn of_rim(&self, _: &Rim) -> Option<OfRim> {
        None
    }

    /// The value of a gauge of a section; `None` for other gauges.
    fn of_section(&self, _: &section::Joint) -> Option<f64> {
        None
    }

    /// Its value where its contour is absent; `None` if it has none then.
    fn of_absent(&self) -> Option<f64> {
        None
    }

    /// The value of a gauge that is worked out from cells; `None` where there was nothing to
    /// measure.
    fn find(&self, _: Evidence<'_>) -> Option<FoundValue> {
        None
    }
}

/// Declares the struct of a kind, with its parameters as recipes have them, each with its domain, as
/// in `smoothing_px: usize = Domain::Pixels { odd: true }`. The documentation of kind and parameters
/// is also what people read of them.
macro_rules! kind {
    // What else is written beside the name of such a kind is ignored.
    ($(#[doc = $doc:literal])+ $kind:ident {}) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct $kind {}

        kind! { @declared $kind concat!($($doc),+); }
    };
    ($(#[doc = $doc:literal])+ $kind:ident {
        $($(#[doc = $about:literal])+ $field:ident: $type:ty = $domain:expr,)+
    }) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq)]
        #[cfg_attr(
            feature = "serde",
            derive(serde::Serialize, serde::Deserialize),
            serde(deny_unknown_fields)
        )]
        pub struct $kind {
            $($(#[doc = $about])+ pub $field: $type,)+
        }

        kind! {
            @declared $kind concat!($($doc),+); $($field: concat!($($about),+), $domain;)+
        }
    };
    (@declared $kind:ident $doc:expr; $($field:ident: $about:expr, $domain:expr;)*) => {
        impl $crate::inspect::gauge::kind::Declared for $kind {
            fn about(&self) -> &'static str {
                $doc.trim_start()
            }

            fn parameters(&self) -> Vec<Parameter> {
                Vec::from([$(Parameter {
                    name: stringify!($field),
                    about: $about.trim_start(),
                    domain: $domain,
                    value: self.$field.into(),
                }),*])
            }
        }
    };
}
pub(super) use kind;

/// The cells of a gauge's regions as they were measured. Those of a kind that compares are along
/// golden's normal.
pub struct Evidence<'a> {
    /// The cells of the gauge's region, then those of the region that it is compared with.
    pub all: &'a [Cell],
    /// How many of the cells are of the gauge's region.
    pub count: usize,
    /// Columns of the grid of the gauge's region.
    pub columns: usize,
    /// σ of a cell's mean, mm.
    pub sigma: f64,
    /// The variance of a single pixel's height in both regions, mm².
    pub variances: [f64; 2],
    /// How the part lies.
    pub placed: Option<&'a Placed>,
    /// An empty buffer with room for a value per cell.
    pub room: &'a mut Vec<f64>,
}

impl<'a> Evidence<'a> {
    /// The cells of the gauge's region.
    pub fn cells(&self) -> &'a [Cell] {
        &self.all[..self.count]
    }

    /// The cells of the region that it is compared with.
    pub fn from(&self) -> &'a [Cell] {
        &self.all[self.count..]
    }

    /// A value that is linear in height, whose derivatives w over the heights of the cells are in
    /// the buffer: σ² = Σ wᵢ² σ_z² / nᵢ + gᵀ C g. n is the number of a cell's pixels, σ_z² the
    /// variance of the height of one pixel, g = Σ wᵢ jᵢ is the derivative of the value over the
    /// motion, j a cell's Jacobian, and C the motion's covariance. The two terms are taken as
    /// independent: the pixels that the motion is found from are one in some dozens of the gauge's.
    pub fn linear(&self, value: f64) -> FoundValue {
        let (mut pixels, mut lever, mut g) = (0.0, 0.0, [0.0; 6]);
        for (at, (w, cell)) in self.room.iter().zip(self.all).enumerate() {
            let variance = self.variances[usize::from(at >= self.count)];
            pixels += w * w * variance / cell.pixels;
            lever += libm::fabs(*w);
            for (g, j) in g.iter_mut().zip(cell.taught.jacobian) {
                *g += w * j;
            }
        }
        FoundValue {
            value,
            pixels,
            motion: motion(&g, self.placed),
            lever,
            unknown: 0.0,
        }
    }
}
