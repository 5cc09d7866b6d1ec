//! The components of a part's motion.

/// A component of a part's motion, in the order of
/// [`Placed::component`](crate::inspect::Placed::component).
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
