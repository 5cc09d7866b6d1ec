//! Why a section has no value, in words.

use core::fmt;

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
