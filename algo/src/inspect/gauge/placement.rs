//! How the part lies.

use super::Measure;
use super::kind::*;
use Component::{AboutX, AboutY, AboutZ, X, Y, Z};

/// A component of a part's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Component {
    /// Translation along x, mm.
    X,
    /// Translation along y, mm.
    Y,
    /// Translation along z, mm.
    Z,
    /// Rotation about x, degrees.
    AboutX,
    /// Rotation about y, degrees.
    AboutY,
    /// Rotation about z, degrees.
    AboutZ,
}

kind! {
    /// A component of the part's motion, mm or degrees.
    Placement {
        /// Which one.
        component: Component,
    }
}

impl Kind for Placement {
    fn facts(&self) -> Facts {
        let (unit, words) = match self.component {
            X => (Unit::Length, "x"),
            Y => (Unit::Length, "y"),
            Z => (Unit::Length, "z"),
            AboutX => (Unit::Angle, "about x"),
            AboutY => (Unit::Angle, "about y"),
            AboutZ => (Unit::Angle, "about z"),
        };
        Facts::new(unit, Basis::Motion(self.component), words)
    }

    fn others(&self) -> Vec<Measure> {
        let all = [X, Y, Z, AboutX, AboutY, AboutZ].into_iter();
        let others = all.filter(|component| *component != self.component);
        others.map(|component| Self { component }.into()).collect()
    }
}
