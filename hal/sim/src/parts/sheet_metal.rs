//! The default part: a stamped sheet-metal bracket with holes, a slot, a bead, a flange.
//!
//! 150 × 110 mm seen from above, upper side of the plate at z = 8 mm: three round holes and a slot,
//! a raised bead, drawn edges, and the +x edge bent down as a flange. The measures are made up for
//! this project.

use serde::{Deserialize, Serialize};

use super::Defect;
use super::defect::{BUMP_SLOPE, bump};
use crate::optics::Vector;
use crate::trace::Surface;
use crate::unfit::Unfit;
use hal::bounds::within;

/// z of the plate's upper side.
const PLATE_Z: f64 = 8.0;
/// The plate's outline without the flange: x from −75 to the bend line and |y| ≤ 55, corners
/// rounded.
const LEFT: f64 = -75.0;
const BEND_LINE: f64 = 50.0;
const HALF_HEIGHT: f64 = 55.0;
const CORNER: f64 = 8.0;
/// Flange: bend radius, straight length after the bend, and the angle it should have.
const BEND_RADIUS: f64 = 4.0;
const FLANGE_LENGTH: f64 = 25.0;
const FLANGE_DEG: f64 = 35.0;
/// Round holes x, y, radius: two small ones for screws and a large one.
const HOLES: [[f64; 3]; 3] = [[-60.0, 40.0, 6.0], [-60.0, -40.0, 6.0], [24.0, 2.0, 11.0]];
/// The slot and the bead run along x between these ends, at this y, with this half-width.
const SLOT: Run = Run {
    from: -32.0,
    to: 12.0,
    y: 36.0,
    half_width: 5.0,
};
const BEAD: Run = Run {
    from: -38.0,
    to: 34.0,
    y: -30.0,
    half_width: 7.0,
};
const BEAD_HEIGHT: f64 = 2.2;
/// The edges are drawn down by this much over this width.
const EDGE_DROP: f64 = 0.4;
const EDGE_WIDTH: f64 = 1.6;

/// The bracket and its defects.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SheetMetal {
    /// Whether it lies upside down.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub upside_down: bool,
    /// Defects; a good part has none.
    pub defects: Vec<Defect>,
}

impl SheetMetal {
    pub(super) fn check(&self) -> Result<(), Unfit> {
        let mut degrees_more = 0.0;
        for defect in &self.defects {
            defect.check_hole(HOLES.len())?;
            if let Defect::BentFlange { degrees } = *defect {
                degrees_more += degrees;
            }
        }
        let bounds = within("part.defects.degrees", degrees_more, -FLANGE_DEG, 40.0);
        Ok(bounds?)
    }
}

/// A straight feature with round ends, along x.
struct Run {
    from: f64,
    to: f64,
    y: f64,
    half_width: f64,
}

impl Run {
    /// Distance from the feature's centre line, at most the half-width. Most rays are farther away,
    /// and a square root for each of them would take a third of the time of a scene.
    fn distance(&self, x: f64, y: f64) -> f64 {
        let (along, across) = (x - x.clamp(self.from, self.to), y - self.y);
        match along.abs().max(across.abs()) < self.half_width {
            true => along.hypot(across).min(self.half_width),
            false => self.half_width,
        }
    }
}

/// The surface of one bracket without its dents.
pub(super) struct Stamping {
    sin: f64,
    cos: f64,
    /// x of the flange's end.
    right: f64,
    holes: Vec<[f64; 3]>,
}

impl Stamping {
    pub(super) fn new(part: &SheetMetal) -> Self {
        let mut degrees = FLANGE_DEG;
        let mut missing = Vec::new();
        for defect in &part.defects {
            match *defect {
                Defect::MissingHole { index } => missing.push(index),
                Defect::BentFlange { degrees: more } => degrees += more,
                _ => {}
            }
        }
        let holes = HOLES
            .iter()
            .enumerate()
            .filter(|(index, _)| !missing.contains(index));
        let (sin, cos) = degrees.to_radians().sin_cos();
        Self {
            sin,
            cos,
            right: BEND_LINE + BEND_RADIUS * sin + FLANGE_LENGTH * cos,
            holes: holes.map(|(_, hole)| *hole).collect(),
        }
    }

    /// The drop of the flange at `x`: a circular arc, then its tangent.
    fn flange_drop(&self, x: f64) -> f64 {
        if x <= BEND_LINE {
            return 0.0;
        }
        let beyond = x - BEND_LINE;
        let arc = beyond.min(BEND_RADIUS * self.sin);
        let on_arc = BEND_RADIUS - (BEND_RADIUS * BEND_RADIUS - arc * arc).sqrt();
        on_arc + (beyond - arc) * self.sin / self.cos
    }

    /// Distance from the rounded outline; positive inside, negative outside.
    fn inside(&self, x: f64, y: f64) -> f64 {
        let middle = (LEFT + self.right) / 2.0;
        let across = (x - middle).abs() - ((self.right - LEFT) / 2.0 - CORNER);
        let down = y.abs() - (HALF_HEIGHT - CORNER);
        let beyond = match across.min(down) > 0.0 {
            true => across.hypot(down),
            false => across.max(down).max(0.0),
        };
        CORNER - beyond - across.max(down).min(0.0)
    }
}

impl Surface for Stamping {
    fn height(&self, x: f64, y: f64) -> f64 {
        let mut z = PLATE_Z - self.flange_drop(x);
        z += BEAD_HEIGHT * bump(BEAD.distance(x, y), BEAD.half_width);
        let drawn = (1.0 - self.inside(x, y) / EDGE_WIDTH).clamp(0.0, 1.0);
        z -= EDGE_DROP * drawn * drawn;
        z
    }

    fn present(&self, x: f64, y: f64) -> bool {
        let in_hole = |[hole_x, hole_y, radius]: &[f64; 3]| {
            (x - hole_x).abs() < *radius && (x - hole_x).hypot(y - hole_y) < *radius
        };
        self.inside(x, y) >= 0.0
            && SLOT.distance(x, y) >= SLOT.half_width
            && !self.holes.iter().any(in_hole)
    }

    fn slope_bound(&self) -> f64 {
        // The bead ends before the bend and away from the drawn edges, so its slope and theirs
        // never add up.
        let bead = BEAD_HEIGHT * BUMP_SLOPE / BEAD.half_width;
        let edge = 2.0 * EDGE_DROP / EDGE_WIDTH;
        (self.sin / self.cos + edge).max(bead)
    }

    fn bounds(&self) -> [Vector; 2] {
        let low = PLATE_Z - self.flange_drop(self.right) - EDGE_DROP;
        [
            [LEFT, -HALF_HEIGHT, low],
            [self.right, HALF_HEIGHT, PLATE_Z + BEAD_HEIGHT],
        ]
    }
}

/// A thin surface that lies upside down: turned over about x, in the middle plane of its box.
pub(super) struct TurnedOver {
    surface: Box<dyn Surface>,
    /// The sum of z of its lowest and of its highest point, mm.
    ends: f64,
}

impl TurnedOver {
    pub fn new(surface: Box<dyn Surface>) -> Self {
        let [low, high] = surface.bounds();
        Self {
            surface,
            ends: low[2] + high[2],
        }
    }
}

impl Surface for TurnedOver {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.ends - self.surface.height(x, -y)
    }

    fn present(&self, x: f64, y: f64) -> bool {
        self.surface.present(x, -y)
    }

    fn albedo(&self, x: f64, y: f64) -> f64 {
        self.surface.albedo(x, -y)
    }

    fn slope_bound(&self) -> f64 {
        self.surface.slope_bound()
    }

    fn bounds(&self) -> [Vector; 2] {
        let [low, high] = self.surface.bounds();
        [[low[0], -high[1], low[2]], [high[0], -low[1], high[2]]]
    }
}
