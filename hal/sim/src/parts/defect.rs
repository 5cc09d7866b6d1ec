//! Defects of parts: dents, which every part with a surface of its own can have, and those of holes
//! and flanges.

use serde::{Deserialize, Serialize};

use hal::bounds::{length, within};

/// Most defects of a scenario.
const MAX_DEFECTS: usize = 64;

/// One defect of a part. A printed board and a joint have none; the other parts can have dents, the
/// sheet metal and the plate also missing holes, the sheet metal a bent flange, the plate holes in
/// other places or of another size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Defect {
    /// A round, smooth dent about the point of the surface above (x, y).
    Dent {
        /// Centre, mm.
        x: f64,
        /// Centre, mm.
        y: f64,
        /// Depth along the surface's normal in mm; negative is a bump.
        depth_mm: f64,
        /// Diameter across the surface, mm.
        diameter_mm: f64,
    },
    /// A round hole that was not punched.
    MissingHole {
        /// Its place in the plate's list. Of the sheet metal 0 and 1 are the small ones at −x, +y
        /// and −y; 2 is the large one.
        index: usize,
    },
    /// A round hole that lies elsewhere.
    DisplacedHole {
        /// Its place in the part's list.
        index: usize,
        /// Towards +x, mm.
        dx: f64,
        /// Towards +y, mm.
        dy: f64,
    },
    /// A round hole of another size.
    HoleRadius {
        /// Its place in the part's list.
        index: usize,
        /// The radius that it has, mm.
        radius: f64,
    },
    /// A flange that is bent too far or too little.
    BentFlange {
        /// Degrees in excess of the nominal angle; negative if bent too little.
        degrees: f64,
    },
}

impl Defect {
    /// Checks the number of defects and the measures of the dents; the error names the key and its
    /// range.
    pub(super) fn check(defects: &[Self]) -> Result<(), String> {
        length("part.defects", defects.len(), 0, MAX_DEFECTS)?;
        for defect in defects {
            if let Self::Dent {
                x,
                y,
                depth_mm,
                diameter_mm,
            } = *defect
            {
                within("part.defects.x", x, -100.0, 100.0)?;
                within("part.defects.y", y, -100.0, 100.0)?;
                within("part.defects.diameter_mm", diameter_mm, 0.5, 200.0)?;
                let deepest = diameter_mm / 2.0;
                within("part.defects.depth_mm", depth_mm, -deepest, deepest)?;
            }
        }
        Ok(())
    }

    /// Checks what is wrong with a hole of a part that has so many of them; the error names the key.
    pub(super) fn check_hole(&self, holes: usize) -> Result<(), String> {
        let index = match *self {
            Self::Dent { .. } | Self::BentFlange { .. } => return Ok(()),
            Self::MissingHole { index } => index,
            Self::DisplacedHole { index, dx, dy } => {
                within("part.defects.dx", dx, -100.0, 100.0)?;
                within("part.defects.dy", dy, -100.0, 100.0)?;
                index
            }
            Self::HoleRadius { index, radius } => {
                within("part.defects.radius", radius, 0.5, 100.0)?;
                index
            }
        };
        match holes.checked_sub(1) {
            Some(last) => within("part.defects.index", index, 0, last),
            None => Err(format!(
                "part.defects.index is {index}: the part has no holes"
            )),
        }
    }
}
