//! How the part lies.

use super::kind::*;

kind! {
    /// A component of the part's motion, mm or degrees.
    Placement {
        /// Which one.
        component: Component = Component::WORDS,
    }
}

impl Kind for Placement {
    fn facts(&self) -> Facts {
        let unit = match self.component {
            Component::X | Component::Y | Component::Z => Unit::Length,
            Component::AboutX | Component::AboutY | Component::AboutZ => Unit::Angle,
        };
        Facts {
            unit,
            words: "{component}",
            ..Facts::new(Basis::Motion(self.component), &[])
        }
    }
}
