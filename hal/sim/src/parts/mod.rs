//! The parts that can be measured: thin surfaces z(x, y) of bounded slope, with nothing behind
//! them, and solids of sheets over a floor.
//!
//! Default sizes are those of the parts in Peng & Gupta's study (2008; docs/measurement.md, *The
//! study's head and parts*); a scenario may change them.

mod board;
mod defect;
mod joint;
mod plate;
mod relief;
mod shapes;
mod sheet;
mod sheet_metal;

use serde::{Deserialize, Serialize};

use super::trace::Surface;
use super::unfit::Unfit;
use hal::bounds::{Bound, Fields, within};

pub use board::Board;
pub use defect::Defect;
pub use joint::{Across, Joint};
pub use plate::{Hole, Joggle, Plate, Slot};
pub use relief::{Face, Handset};
pub use shapes::{Cone, Flowerpot, Plane, Sawtooth, Sphere, Spline, Tube};
pub use sheet::Floor;
pub(crate) use sheet::Solid;
pub use sheet_metal::SheetMetal;

/// A part by kind, with its measures in mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Part {
    /// A block with a cone-shaped hole.
    Cone(Cone),
    /// Ridges along y.
    Sawtooth(Sawtooth),
    /// The upper part of a sphere.
    Sphere(Sphere),
    /// A lying cylinder.
    Tube(Tube),
    /// An open truncated cone.
    Flowerpot(Flowerpot),
    /// A free-form surface.
    Spline(Box<Spline>),
    /// A face.
    Face(Face),
    /// The base of a telephone's handset.
    Handset(Handset),
    /// A flat square.
    Plane(Plane),
    /// A printed checkerboard.
    Board(Board),
    /// A stamped bracket, the default.
    SheetMetal(SheetMetal),
    /// A flat sheet with holes and slots over a floor.
    Plate(Plate),
    /// Two sheets with a gap between them.
    Joint(Joint),
    /// Nothing at all.
    Empty {},
}

impl Default for Part {
    fn default() -> Self {
        Self::SheetMetal(SheetMetal::default())
    }
}

impl Part {
    /// One good part of each kind of thin surface with its default measures. Plate and joint are not
    /// among them.
    #[must_use]
    pub fn stock() -> [Self; 12] {
        [
            Self::SheetMetal(SheetMetal::default()),
            Self::Flowerpot(Flowerpot::default()),
            Self::Cone(Cone::default()),
            Self::Sawtooth(Sawtooth::default()),
            Self::Sphere(Sphere::default()),
            Self::Tube(Tube::default()),
            Self::Spline(Box::default()),
            Self::Face(Face::default()),
            Self::Handset(Handset::default()),
            Self::Plane(Plane::default()),
            Self::Board(Board::default()),
            Self::Empty {},
        ]
    }

    /// Checks the measures of the part and of its defects.
    pub(crate) fn check(&self) -> Result<(), Unfit> {
        Defect::check(self.defects())?;
        for defect in self.defects() {
            self.can_have(defect).map_err(Unfit::Defect)?;
        }
        match self {
            Self::Cone(part) => Fields.check("part", part)?,
            Self::Sawtooth(part) => Fields.check("part", part)?,
            Self::Sphere(part) => {
                Fields.check("part", part)?;
                // Lower than a tenth of the radius above the centre, the surface is too steep for a
                // height field.
                let low = part.centre_z + 0.1 * part.radius;
                within("part.cut", part.cut, low, part.centre_z + part.radius)?;
            }
            Self::Tube(part) => Fields.check("part", part)?,
            Self::Flowerpot(part) => {
                Fields.check("part", part)?;
                // The wall leans outwards by at least 0.025 mm per mm of depth: a height field has
                // no upright walls.
                let least = part.bottom_diameter + 0.05 * part.depth;
                within("part.rim_diameter", part.rim_diameter, least, 1000.0)?;
            }
            Self::Spline(part) => Fields.check("part", &**part)?,
            Self::Plane(part) => Fields.check("part", part)?,
            Self::Board(part) => Fields.check("part", part)?,
            Self::SheetMetal(part) => part.check()?,
            Self::Plate(part) => part.check()?,
            Self::Joint(part) => part.check()?,
            // The measures of these parts are fixed.
            Self::Face(_) | Self::Handset(_) | Self::Empty {} => {}
        }
        Ok(())
    }

    /// Its defects.
    #[must_use]
    pub fn defects(&self) -> &[Defect] {
        match self {
            Self::Cone(Cone { defects, .. })
            | Self::Sawtooth(Sawtooth { defects, .. })
            | Self::Sphere(Sphere { defects, .. })
            | Self::Tube(Tube { defects, .. })
            | Self::Flowerpot(Flowerpot { defects, .. })
            | Self::Face(Face { defects })
            | Self::Handset(Handset { defects })
            | Self::Plane(Plane { defects, .. })
            | Self::Plate(Plate { defects, .. })
            | Self::SheetMetal(SheetMetal { defects, .. }) => defects,
            Self::Spline(part) => &part.defects,
            Self::Board(_) | Self::Joint(_) | Self::Empty {} => &[],
        }
    }

    /// Its defects, to be changed; `None` if it can have none.
    pub fn defects_mut(&mut self) -> Option<&mut Vec<Defect>> {
        match self {
            Self::Cone(Cone { defects, .. })
            | Self::Sawtooth(Sawtooth { defects, .. })
            | Self::Sphere(Sphere { defects, .. })
            | Self::Tube(Tube { defects, .. })
            | Self::Flowerpot(Flowerpot { defects, .. })
            | Self::Face(Face { defects })
            | Self::Handset(Handset { defects })
            | Self::Plane(Plane { defects, .. })
            | Self::Plate(Plate { defects, .. })
            | Self::SheetMetal(SheetMetal { defects, .. }) => Some(defects),
            Self::Spline(part) => Some(&mut part.defects),
            Self::Board(_) | Self::Joint(_) | Self::Empty {} => None,
        }
    }

    /// Whether it can have a defect of this kind.
    ///
    /// # Errors
    /// If it cannot; the message says which defects it can have.
    pub fn can_have(&self, defect: &Defect) -> Result<(), &'static str> {
        match (self, defect) {
            (Self::Board(_) | Self::Joint(_) | Self::Empty {}, _) => Err("it can have no defects"),
            (_, Defect::Dent { .. })
            | (Self::SheetMetal(_), Defect::MissingHole { .. } | Defect::BentFlange { .. }) => {
                Ok(())
            }
            (Self::Plate(_), Defect::BentFlange { .. }) => Err("it has no flange"),
            (Self::Plate(_), _) => Ok(()),
            (Self::SheetMetal(_), _) => {
                Err("its holes can be missing, but not displaced or of another radius")
            }
            _ => Err("it can have dents only: write kind = \"dent\""),
        }
    }

    /// The thin surface to trace; `None` for those that are solids, and for [`Part::Empty`].
    pub(crate) fn surface(&self) -> Option<Box<dyn Surface>> {
        let good: Box<dyn Surface> = match self {
            Self::Cone(part) => Box::new(part.clone()),
            Self::Sawtooth(part) => Box::new(part.clone()),
            Self::Sphere(part) => Box::new(part.clone()),
            Self::Tube(part) => Box::new(part.clone()),
            Self::Flowerpot(part) => Box::new(part.clone()),
            Self::Spline(part) => Box::new((**part).clone()),
            Self::Face(_) => Box::new(Face::surface()),
            Self::Handset(_) => Box::new(Handset::surface()),
            Self::Plane(part) => Box::new(part.clone()),
            Self::Board(part) => Box::new(part.clone()),
            Self::SheetMetal(part) => {
                let stamping = Box::new(sheet_metal::Stamping::new(part));
                match part.upside_down {
                    true => Box::new(sheet_metal::TurnedOver::new(stamping)),
                    false => stamping,
                }
            }
            Self::Plate(_) | Self::Joint(_) | Self::Empty {} => return None,
        };
        let is_dent = |defect: &Defect| matches!(defect, Defect::Dent { .. });
        Some(match self.defects().iter().any(is_dent) {
            true => Box::new(defect::Dented::new(good, self.defects())),
            false => good,
        })
    }

    /// z of its lowest point as designed, mm; 0 of nothing.
    pub(crate) fn lowest(&self) -> f64 {
        let thin = self.surface().map(|surface| surface.bounds()[0][2]);
        thin.or_else(|| self.solid().map(|solid| solid.lowest()))
            .unwrap_or(0.0)
    }

    /// The solid to trace, of plate and joint.
    pub(crate) fn solid(&self) -> Option<Solid> {
        match self {
            Self::Plate(part) => Some(part.solid()),
            Self::Joint(part) => Some(part.solid()),
            _ => None,
        }
    }
}
