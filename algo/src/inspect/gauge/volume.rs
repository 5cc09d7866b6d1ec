//! The volume above a plane.

use super::kind::*;

kind! {
    /// The volume between the surface and the plane z = `above_mm`, mm³, negative below it.
    Volume {
        /// z of the plane, mm.
        above_mm: f64 = Domain::Length { positive: false },
    }
}

impl Kind for Volume {
    fn facts(&self) -> Facts {
        Facts {
            unit: Unit::Volume,
            words: "above {above_mm} mm",
            ..Facts::new(Basis::Region, SURFACE)
        }
    }

    /// Each cell's area in x and y as taught times its height.
    fn find(&self, of: Evidence<'_>) -> Option<FoundValue> {
        let cells = of.cells();
        let each = |cell: &Cell| cell.taught.area * (cell.height - self.above_mm);
        of.room.extend(cells.iter().map(|cell| cell.taught.area));
        (!cells.is_empty()).then(|| of.linear(cells.iter().map(each).sum()))
    }
}
