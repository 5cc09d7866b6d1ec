//! How the part lies.

use super::component::Component;
use super::kind::*;
use Component::{AboutX, AboutY, AboutZ, X, Y, Z};

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
        Facts {
            takes: &[],
            ..Facts::new(unit, Basis::Motion(self.component), words)
        }
    }

    fn others(&self) -> Vec<Self> {
        let all = [X, Y, Z, AboutX, AboutY, AboutZ].into_iter();
        let others = all.filter(|component| *component != self.component);
        others.map(|component| Self { component }).collect()
    }
}
