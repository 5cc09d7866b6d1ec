//! The ten parts of the demonstration.

use sim::Part;
use sim::parts::{Defect, SheetMetal};

/// A part that is put in front of the head.
pub struct DemoPart {
    /// For people.
    pub what: &'static str,
    /// Its defect, if it has one.
    pub defect: Option<Defect>,
}

const GOOD: DemoPart = DemoPart {
    what: "good",
    defect: None,
};

/// Seven good parts, and one each with a dent, a missing hole and a bent flange.
pub const PARTS: [DemoPart; 10] = [
    GOOD,
    GOOD,
    DemoPart {
        what: "dent 0.6 mm",
        defect: Some(Defect::Dent {
            x: 0.0,
            y: -8.0,
            depth_mm: 0.6,
            diameter_mm: 14.0,
        }),
    },
    GOOD,
    GOOD,
    DemoPart {
        what: "missing hole",
        defect: Some(Defect::MissingHole { index: 1 }),
    },
    GOOD,
    DemoPart {
        what: "bent flange 3°",
        defect: Some(Defect::BentFlange { degrees: 3.0 }),
    },
    GOOD,
    GOOD,
];

impl DemoPart {
    /// The part as the simulator takes it.
    pub fn part(&self) -> Part {
        Part::SheetMetal(SheetMetal {
            defects: self.defect.into_iter().collect(),
            ..SheetMetal::default()
        })
    }
}
