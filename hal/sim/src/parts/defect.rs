//! Defects of parts: dents, which every part with a surface of its own can have, and those of the
//! sheet metal alone.

use serde::{Deserialize, Serialize};

use hal::bounds::{length, within};

/// Most defects of a scenario.
const MAX_DEFECTS: usize = 64;

/// One defect of a part. The sheet metal can have all of them, a printed board none, and the other
/// parts dents.
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
        /// 0 and 1 are the small ones at −x, +y and −y; 2 is the large one.
        index: usize,
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
}
