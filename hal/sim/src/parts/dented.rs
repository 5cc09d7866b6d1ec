//! A surface with round, smooth dents along its normal, also where the surface is steep.
//!
//! A dent of depth d and diameter D at the point c of the surface lowers z by d/n_z · cos²(π/2 · r
//! / (D/2)), where r is the distance in space from c to the undented surface, and n the unit normal
//! at c: d is measured along the normal, and D across the surface.

use super::bump::{BUMP_SLOPE, bump};
use super::{Defect, Surface};
use crate::optics::Vector;

/// Half the distance over which slopes are computed, mm.
const SLOPE_MM: f64 = 1e-3;

/// A surface and its dents.
pub(super) struct Dented {
    surface: Box<dyn Surface>,
    dents: Vec<Dent>,
}

struct Dent {
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
                Some(Dent {
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
        let drop = |dent: &Dent| {
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
        let steepest = |dent: &Dent| dent.drop.abs() * BUMP_SLOPE / dent.half_width;
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
