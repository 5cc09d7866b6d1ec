//! What is asked of a section, and why it is not measured.

use core::fmt;

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

/// A side of the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The one at smaller s.
    Left,
    /// The one at larger s.
    Right,
}

/// Why a section is not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unseen {
    /// At which of its sides.
    pub side: Side,
    /// Why.
    pub why: Why,
}

/// What is wrong with a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Why {
    /// Its stretch does not end before the joint, or is not finite.
    Order,
    /// The radius of its edge is stated, but is not a length.
    Radius,
    /// Its stretch has too few points.
    FewPoints {
        /// How many it has.
        has: usize,
        /// How many are needed.
        needs: usize,
    },
    /// The points of its stretch do not reach over enough of it.
    ShortStretch {
        /// Over which share they reach.
        share: f64,
        /// The share that is needed.
        needs: f64,
    },
    /// Its stretch is not flat.
    NotFlat {
        /// RMS distance of its heights from their line beyond what noise makes, mm.
        off: f64,
        /// The largest that is accepted, mm.
        most: f64,
    },
    /// No height beyond the stretch leaves its line.
    Edgeless,
    /// What leaves the line is no circle's arc that is tangent to it.
    NotRound,
    /// Pixels are too coarse or too few to tell the edge's radius, and it is not stated.
    Uncertain {
        /// σ of the radius by noise and blur, mm.
        sigma: f64,
        /// The radius, mm.
        r: f64,
    },
    /// Too little of the edge is seen.
    ShortArc {
        /// The arc that is seen, °.
        degrees: f64,
        /// The arc that is needed, °.
        needs: f64,
        /// Whether its radius is stated, which needs less.
        stated: bool,
    },
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

impl fmt::Display for Unseen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = self.side;
        match self.why {
            Why::Order => write!(
                f,
                "the {side} stretch must have a length, and lie on its side of the other"
            ),
            Why::Radius => write!(f, "edge_mm of the {side} edge must be more than 0"),
            Why::FewPoints { has, needs } => write!(
                f,
                "the {side} stretch has {has} points where {needs} are needed: widen the section \
                 or move the stretch"
            ),
            Why::ShortStretch { share, needs } => write!(
                f,
                "the points of the {side} stretch reach over {:.0} % of it where {:.0} % are \
                 needed: move it to where heights are measured",
                share * 100.0,
                needs * 100.0
            ),
            Why::NotFlat { off, most } => write!(
                f,
                "the {side} stretch is not flat: its heights are {off:.3} mm off their line, more \
                 than {most:.3} mm: shorten or move it"
            ),
            Why::Edgeless => write!(
                f,
                "no edge is seen beyond the {side} stretch: no height leaves its line"
            ),
            Why::NotRound => write!(
                f,
                "what is seen of the {side} edge is not an arc tangent to its stretch"
            ),
            Why::Uncertain { sigma, r } => write!(
                f,
                "the radius of the {side} edge is {r:.2} mm with a σ of {sigma:.2} mm, too much \
                 to say where it ends: state edge_mm"
            ),
            Why::ShortArc {
                degrees,
                needs,
                stated,
            } => {
                write!(
                    f,
                    "an arc of {degrees:.0}° of the {side} edge is seen where {needs:.0}° are \
                     needed"
                )?;
                f.write_str(if stated { "" } else { ": state edge_mm" })
            }
        }
    }
}
