//! The components of a part's motion.

use super::parameter::{Domain, Value, words};

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
