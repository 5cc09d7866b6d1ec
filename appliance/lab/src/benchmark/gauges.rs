//! The gauges of a cycle that is timed: those of the recipe, or many of one kind.

use algo::geometry::Vector;
use algo::inspect::kinds::{Diameter, Distance, MeanHeight, Z};
use algo::inspect::{FeatureKind, Measure};
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
    /// The mean height of each region; how many regions.
    Means(usize),
    /// The height of the plane of each region; how many regions.
    Planes(usize),
    /// The same, and the distance of each plane from the next.
    Distances(usize),
    /// The diameter of holes, those of the part again and again; how many.
    Holes(usize),
}

impl Gauges {
    /// Those that are timed beside the taught ones: planes, and the same regions as mean heights.
    pub const MANY: [Self; 6] = [
        Self::Means(8),
        Self::Planes(8),
        Self::Means(32),
        Self::Planes(32),
        Self::Distances(32),
        // Their rims are as long together as those of 32 holes of 3 mm.
        Self::Holes(12),
    ];

    /// Columns that a frame has at least: with fewer, holes have no rim.
    pub fn need_columns(self) -> u32 {
        match self {
            Self::Holes(_) => 512,
            _ => 0,
        }
    }

    /// In words, for tables.
    pub fn words(self) -> String {
        match self {
            Self::Taught => "as taught".into(),
            Self::Means(count) => format!("{count} mean heights"),
            Self::Planes(count) => format!("{count} planes"),
            Self::Distances(count) => format!("{count} planes, {} gauges", 2 * count),
            Self::Holes(count) => format!("{count} holes"),
        }
    }

    /// Gives them to a recipe for frames of (width, height).
    pub fn replace(self, file: &mut RecipeFile, (width, height): (u32, u32)) {
        let (z, plane) = (Z {}.into(), FeatureKind::Plane);
        let (count, kind, kinds): (_, _, Vec<Measure>) = match self {
            Self::Taught => return,
            Self::Holes(count) => return holes(file, count),
            Self::Means(count) => (count, FeatureKind::Surface, vec![MeanHeight {}.into()]),
            Self::Planes(count) => (count, plane, vec![z]),
            Self::Distances(count) => (count, plane, vec![z, Distance {}.into()]),
        };
        let name = |at: usize| format!("region {}", at % count);
        let rows = count.div_ceil(COLUMNS);
        let region = |at: usize| {
            let corner = |right: usize, down: usize| {
                let share = |axis: usize, step: usize, steps: usize| {
                    BOX[0][axis] + (BOX[1][axis] - BOX[0][axis]) * step as f64 / steps as f64
                };
                let (column, row) = (at % COLUMNS + right, at / COLUMNS + down);
                [
                    share(0, column, COLUMNS) * f64::from(width),
                    share(1, row, rows) * f64::from(height),
                ]
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
            let features = measures.facts().takes.len();
            file.gauges.push(GaugeFile {
                of: (0..features).map(|next| name(at + next)).collect(),
                ..GaugeFile::new(slot, &format!("gauge {slot}"), measures.clone(), &[])
            });
        }
        file.judges_nothing = true;
    }
}

/// The holes of the default part: x, y and radius, and z of its plate, mm.
const HOLES: [[f64; 3]; 3] = [[-60.0, 40.0, 6.0], [-60.0, -40.0, 6.0], [24.0, 2.0, 11.0]];
const PLATE_MM: f64 = 8.0;
/// A region reaches so far beyond a hole, mm.
const AROUND_MM: f64 = 2.5;

/// Gives a recipe of the default part the diameters of `count` holes. A head that cannot be modelled
/// has none.
fn holes(file: &mut RecipeFile, count: usize) {
    let Ok(head) = file.head() else { return };
    file.features.clear();
    file.gauges.clear();
    for (slot, [x, y, radius]) in (1..).zip(HOLES.into_iter().cycle().take(count)) {
        let reach = radius + AROUND_MM;
        let corner = |at: usize| {
            let (sin, cos) = (std::f64::consts::TAU * at as f64 / 16.0).sin_cos();
            let point = Vector::new(x + reach * cos, y + reach * sin, PLATE_MM);
            let (u, v) = head.camera.project(point)?;
            Some([u, v])
        };
        let name = format!("hole {slot}");
        let region = (0..16).filter_map(corner).collect();
        file.features
            .push(FeatureFile::new(&*name, FeatureKind::Circle, region));
        let gauge = format!("gauge {slot}");
        file.gauges
            .push(GaugeFile::new(slot, &gauge, Diameter {}, &[&name]));
    }
    file.judges_nothing = true;
}
