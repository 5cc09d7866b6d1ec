//! A flat rectangular sheet with round holes, slots and a joggle, over a floor.

use super::Defect;
use super::sheet::{Fall, Floor, Opening, Sheet, SheetDent, Solid};
use crate::unfit::Unfit;
use hal::bounded;
use hal::bounds::{Bound, Fields, length, within};

/// Most holes, and most slots.
const MAX_OPENINGS: usize = 64;

bounded! {
    /// A sheet about the z axis, its sides along x and y.
    pub struct Plate: Default {
        /// Extent along x, mm.
        pub width: f64 = 1.0..=1000.0 => 150.0,
        /// Extent along y, mm.
        pub height: f64 = 1.0..=1000.0 => 110.0,
        /// z of the upper side, mm.
        pub z: f64 = -1000.0..=1000.0 => 8.0,
        /// Thickness, mm; 0 is a face without walls.
        pub thickness_mm: f64 = 0.0..=100.0,
        /// Radius to which the upper edges of outline, holes and slots are rounded, mm. A sheet
        /// that is thinner has walls that end as deep.
        pub rim_mm: f64 = 0.0..=20.0,
        /// Whether it lies upside down: turned over about x.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        pub upside_down: bool,
        /// Round holes.
        pub holes: Vec<Hole> = Fields => vec![
            Hole { x: -60.0, y: 40.0, radius: 6.0 },
            Hole { x: -60.0, y: -40.0, radius: 6.0 },
            Hole { x: 24.0, y: 2.0, radius: 11.0 },
        ],
        /// Slots.
        pub slots: Vec<Slot> = Fields => vec![
            Slot { from: [-32.0, 36.0], to: [12.0, 36.0], half_width: 5.0 },
        ],
        /// Where the upper side falls, if it does.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub joggle: Option<Joggle> = Fields,
        /// What lies below.
        pub floor: Floor = Fields,
        /// Dents, and what is wrong with the holes; a good part has none.
        pub defects: Vec<Defect>,
    }

    /// A round hole with upright walls.
    #[derive(Copy)]
    pub struct Hole {
        /// Centre, mm.
        pub x: f64 = -1000.0..=1000.0,
        /// Centre, mm.
        pub y: f64 = -1000.0..=1000.0,
        /// Radius, mm.
        pub radius: f64 = 0.5..=1000.0,
    }

    /// A straight slot with round ends and upright walls.
    #[derive(Copy)]
    pub struct Slot {
        /// Centre of one end, mm.
        pub from: [f64; 2] = -1000.0..=1000.0,
        /// Centre of the other end, mm.
        pub to: [f64; 2] = -1000.0..=1000.0,
        /// Half the distance between its sides, and the radius of its ends, mm.
        pub half_width: f64 = 0.5..=1000.0,
    }

    /// A step of the sheet along y.
    #[derive(Copy)]
    pub struct Joggle: Default {
        /// Where the middle of the step lies, mm.
        pub x: f64 = -1000.0..=1000.0 => 40.0,
        /// By how much the side towards +x is lower, mm; negative: higher.
        pub drop: f64 = -100.0..=100.0 => 3.0,
        /// Extent of the step along x, mm; 0 is upright.
        pub run: f64 = 0.0..=1000.0 => 3.0,
    }
}

impl Plate {
    /// The holes in their order, as the defects leave them; a hole that was not punched is `None`.
    #[must_use]
    pub fn punched(&self) -> Vec<Option<Hole>> {
        let mut holes: Vec<_> = self.holes.iter().copied().map(Some).collect();
        for defect in &self.defects {
            let (Defect::MissingHole { index }
            | Defect::DisplacedHole { index, .. }
            | Defect::HoleRadius { index, .. }) = *defect
            else {
                continue;
            };
            let Some(slot) = holes.get_mut(index) else {
                continue;
            };
            *slot = slot.and_then(|hole| match *defect {
                Defect::DisplacedHole { dx, dy, .. } => Some(Hole {
                    x: hole.x + dx,
                    y: hole.y + dy,
                    ..hole
                }),
                Defect::HoleRadius { radius, .. } => Some(Hole { radius, ..hole }),
                _ => None,
            });
        }
        holes
    }

    pub(super) fn check(&self) -> Result<(), Unfit> {
        Fields.check("part", self)?;
        length("part.holes", self.holes.len(), 0, MAX_OPENINGS)?;
        length("part.slots", self.slots.len(), 0, MAX_OPENINGS)?;
        self.defects
            .iter()
            .try_for_each(|defect| defect.check_hole(self.holes.len()))?;
        let drop = self
            .joggle
            .map_or(0.0, |joggle| (self.side() * joggle.drop).max(0.0));
        match self.floor.albedo > 0.0 {
            true => Ok(within(
                "part.floor.depth",
                self.floor.depth,
                self.sheet() + drop,
                1000.0,
            )?),
            false => Ok(()),
        }
    }

    /// What becomes of y, and of drops, where it is turned over.
    fn side(&self) -> f64 {
        if self.upside_down { -1.0 } else { 1.0 }
    }

    /// The thickness with which it is traced.
    fn sheet(&self) -> f64 {
        self.thickness_mm.max(self.rim_mm)
    }

    pub(super) fn solid(&self) -> Solid {
        let half = [self.width / 2.0, self.height / 2.0];
        let side = self.side();
        let holes = self.punched().into_iter().flatten().map(|hole| Opening {
            from: [hole.x, side * hole.y],
            to: [hole.x, side * hole.y],
            half_width: hole.radius,
        });
        let turned = |[x, y]: [f64; 2]| [x, side * y];
        let slots = self.slots.iter().map(|slot| Opening {
            from: turned(slot.from),
            to: turned(slot.to),
            half_width: slot.half_width,
        });
        let dents = self.defects.iter().filter_map(|defect| match *defect {
            Defect::Dent {
                x,
                y,
                depth_mm,
                diameter_mm,
            } => Some(SheetDent {
                centre: [x, y],
                depth: depth_mm,
                half_width: diameter_mm / 2.0,
            }),
            _ => None,
        });
        let sheet = Sheet {
            origin: [0.0, 0.0, self.z],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            outline: [half.map(|half| -half), half],
            openings: holes.chain(slots).collect(),
            joggle: self
                .joggle
                .filter(|joggle| joggle.drop != 0.0)
                .map(|joggle| Fall {
                    from: joggle.x - joggle.run / 2.0,
                    to: joggle.x + joggle.run / 2.0,
                    drop: side * joggle.drop,
                }),
            dents: dents.collect(),
            thickness: self.sheet(),
            rim: self.rim_mm,
        };
        Solid::new(vec![sheet], self.z, &self.floor)
    }
}
