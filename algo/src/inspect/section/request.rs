//! What a section is measured from, and where in it its stretches lie.

/// A point of a section, in the section's plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SectionPoint {
    /// How far along the section, mm.
    pub s: f64,
    /// Height, mm.
    pub z: f64,
    /// Variance of the height by noise, mm².
    pub variance: f64,
}

/// Where the sides of a joint are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// From where to where the left side is flat, mm along the section.
    pub left: [f64; 2],
    /// The same of the right side.
    pub right: [f64; 2],
    /// Radius of the left and of the right edge, mm, where it is stated: it is taken as it is, and
    /// only where its circle lies is found.
    pub edge_mm: [Option<f64>; 2],
}

/// How a section is seen. Slopes are the components of directions in the section's plane: mm along
/// s per mm of z, positive towards larger s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// σ of what a pixel averages across its line of sight, mm: √(σ_C² + 1/12) px times mm per px,
    /// σ_C the camera's blur in px.
    pub blur: f64,
    /// Slope of the direction to the camera.
    pub sight: f64,
    /// Slope of the direction to the projector.
    pub light: f64,
}
