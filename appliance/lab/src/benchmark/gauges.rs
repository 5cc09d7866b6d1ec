//! The gauges of a cycle that is timed: those of the recipe, or many of one kind.

use algo::inspect::{Basis, FeatureKind, Measure};
use appliance::recipe::{FeatureFile, GaugeFile, RecipeFile};

/// Where the regions lie, as shares of the frame: on the plate of the default part.
const BOX: [[f64; 2]; 2] = [[0.22, 0.22], [0.66, 0.78]];
/// Regions side by side.
const COLUMNS: usize = 8;

/// What is measured of regions of the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gauges {
    /// The gauges that teaching proposes.
    Taught,
    /// The mean height of each of so many regions.
    Means(usize),
    /// The height of the plane of each of so many regions.
    Planes(usize),
    /// The same, and the distance of each plane from the next.
    Distances(usize),
}

impl Gauges {
    /// Those that are timed beside the taught ones: planes, and the same regions as mean heights.
    pub const MANY: [Self; 5] = [
        Self::Means(8),
        Self::Planes(8),
        Self::Means(32),
        Self::Planes(32),
        Self::Distances(32),
    ];

    /// In words, for tables.
    pub fn words(self) -> String {
        match self {
            Self::Taught => "as taught".into(),
            Self::Means(count) => format!("{count} mean heights"),
            Self::Planes(count) => format!("{count} planes"),
            Self::Distances(count) => format!("{count} planes, {} gauges", 2 * count),
        }
    }

    /// Gives them to a recipe for frames of (width, height).
    pub fn replace(self, file: &mut RecipeFile, (width, height): (u32, u32)) {
        let (count, kinds) = match self {
            Self::Taught => return,
            Self::Means(count) => (count, kinds(Basis::Region, &[1])),
            Self::Planes(count) => (count, kinds(Basis::Geometry, &[1])),
            Self::Distances(count) => (count, kinds(Basis::Geometry, &[1, 2])),
        };
        let name = |at: usize| format!("region {}", at % count);
        let rows = count.div_ceil(COLUMNS);
        let region = |at: usize| {
            let corner = |right: usize, down: usize| {
                let share = |axis: usize, at: usize, of: usize| {
                    BOX[0][axis] + (BOX[1][axis] - BOX[0][axis]) * at as f64 / of as f64
                };
                let (column, row) = (at % COLUMNS + right, at / COLUMNS + down);
                [
                    share(0, column, COLUMNS) * f64::from(width),
                    share(1, row, rows) * f64::from(height),
                ]
            };
            let kind = match self {
                Self::Taught | Self::Means(_) => FeatureKind::Surface,
                Self::Planes(_) | Self::Distances(_) => FeatureKind::Plane,
            };
            let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
            let corners = corners.map(|(right, down)| corner(right, down));
            FeatureFile::new(name(at), kind, corners.to_vec())
        };
        file.features = (0..count).map(region).collect();
        file.gauges.clear();
        let all = kinds
            .iter()
            .flat_map(|kind| (0..count).map(move |at| (kind, at)));
        for (slot, (measures, at)) in (1..).zip(all) {
            let of = (0..measures.facts().takes.len()).map(|place| name(at + place));
            file.gauges.push(GaugeFile {
                of: of.collect(),
                ..GaugeFile::new(slot, &format!("gauge {slot}"), measures.clone(), &[])
            });
        }
        file.judges_nothing = true;
    }
}

/// The first kind in the table that is worked out from this, for each of these numbers of features.
fn kinds(basis: Basis, features: &[usize]) -> Vec<Measure> {
    let first = |&count: &usize| {
        let mut all = Measure::examples().into_iter();
        all.find(|kind| {
            let facts = kind.facts();
            facts.basis == basis && facts.takes.len() == count
        })
    };
    features.iter().filter_map(first).collect()
}
