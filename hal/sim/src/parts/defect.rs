//! Defects of parts: round, smooth dents, which every part with a surface of its own can have, and
//! those of holes and flanges.
//!
//! A dent of depth d and diameter D at the point c of a thin surface lowers z by d/n_z · cos²(π/2 · r
//! / (D/2)), where r is the distance in space from c to the undented surface, and n the unit normal
//! at c: d is measured along the normal, and D across the surface, also where it is steep.

use serde::{Deserialize, Serialize};

use crate::optics::Vector;
use crate::trace::Surface;
use crate::unfit::Unfit;
use hal::bounds::{OutOfBounds, length, within};

/// Most defects of a scenario.
const MAX_DEFECTS: usize = 64;
/// Half the distance over which slopes are computed, mm.
const SLOPE_MM: f64 = 1e-3;

/// The largest slope of [`bump`], multiplied by the half-width.
pub(super) const BUMP_SLOPE: f64 = std::f64::consts::FRAC_PI_2;

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
    /// Checks the number of defects and the measures of the dents.
    pub(super) fn check(defects: &[Self]) -> Result<(), OutOfBounds> {
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

    /// Checks a defect of a hole of a part that has so many of them.
    pub(super) fn check_hole(&self, holes: usize) -> Result<(), Unfit> {
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
            Some(last) => Ok(within("part.defects.index", index, 0, last)?),
            None => Err(Unfit::NoHoles { index }),
        }
    }
}

/// A surface and its dents.
pub(super) struct Dented {
    surface: Box<dyn Surface>,
    dents: Vec<SurfaceDent>,
}

/// A dent of a thin surface.
struct SurfaceDent {
    centre: Vector,
    /// The depth of the dent along z.
    drop: f64,
    half_width: f64,
}

impl Dented {
    /// The surface with the dents among the defects; other defects are ignored.
    pub fn new(surface: Box<dyn Surface>, defects: &[Defect]) -> Self {
        let dent = |defect: &Defect| match *defect {
            Defect::Dent {
                x,
                y,
                depth_mm,
                diameter_mm,
            } => {
                let along = surface.height(x + SLOPE_MM, y) - surface.height(x - SLOPE_MM, y);
                let down = surface.height(x, y + SLOPE_MM) - surface.height(x, y - SLOPE_MM);
                let slope = along.hypot(down) / (2.0 * SLOPE_MM);
                Some(SurfaceDent {
                    centre: [x, y, surface.height(x, y)],
                    drop: depth_mm * slope.hypot(1.0),
                    half_width: diameter_mm / 2.0,
                })
            }
            _ => None,
        };
        let dents = defects.iter().filter_map(dent).collect();
        Self { surface, dents }
    }
}

impl Surface for Dented {
    fn height(&self, x: f64, y: f64) -> f64 {
        let z = self.surface.height(x, y);
        let drop = |dent: &SurfaceDent| {
            let [cx, cy, cz] = dent.centre;
            let (dx, dy) = (x - cx, y - cy);
            // Most rays are far away; skip the square root for them.
            match dx.abs().max(dy.abs()) < dent.half_width {
                true => dent.drop * bump(dx.hypot(dy).hypot(z - cz), dent.half_width),
                false => 0.0,
            }
        };
        z - self.dents.iter().map(drop).sum::<f64>()
    }

    fn present(&self, x: f64, y: f64) -> bool {
        self.surface.present(x, y)
    }

    fn albedo(&self, x: f64, y: f64) -> f64 {
        self.surface.albedo(x, y)
    }

    fn slope_bound(&self) -> f64 {
        let slope = self.surface.slope_bound();
        // The distance in space changes by up to √(1 + slope²) per mm in x and y.
        let steepest = |dent: &SurfaceDent| dent.drop.abs() * BUMP_SLOPE / dent.half_width;
        slope + self.dents.iter().map(steepest).sum::<f64>() * slope.hypot(1.0)
    }

    fn bounds(&self) -> [Vector; 2] {
        let [mut low, mut high] = self.surface.bounds();
        for dent in &self.dents {
            low[2] -= dent.drop.max(0.0);
            high[2] += (-dent.drop).max(0.0);
        }
        [low, high]
    }
}

/// The profile of dents and beads, a smooth, round elevation: cos² from 1 at distance 0 to 0 at `half_width`, smooth at both; its slope is at most π / (2 ·
/// half_width).
pub(super) fn bump(distance: f64, half_width: f64) -> f64 {
    if distance >= half_width {
        return 0.0;
    }
    let cos = (std::f64::consts::FRAC_PI_2 * distance / half_width).cos();
    cos * cos
}
