//! The gauges of a production: where each measures what, and what is planned of that beforehand.

use super::coverage::Threshold;
use super::squares::extreme;
use crate::geometry::Vector;
use crate::inspect::align::{Alignment, GoldenSurface};
use crate::inspect::feature::{
    Feature, FeatureKind, Grid, TaughtCell, TooFine, keep_face, taught_cells,
};
use crate::inspect::gauge::{Basis, Measure, makes_datum};
use crate::inspect::region::Region;
use crate::inspect::strips::align::PoseField;
use crate::math::hull;
use alloc::vec::Vec;
use core::ops::Range;

/// A gauge: what it measures of which features.
#[derive(Clone, Debug, PartialEq)]
pub struct Gauge {
    /// Which of the production's features, in the order of the measure's places.
    pub of: Vec<usize>,
    /// Those of the datum system in which it is measured; none in the frame as taught.
    pub datum: Vec<usize>,
    /// What.
    pub measure: Measure,
}

impl Gauge {
    /// All features that it needs, some of them perhaps twice: its own, those of its datum system,
    /// and the planes of contours among them.
    pub fn needs<'a>(&'a self, features: &'a [Feature]) -> impl Iterator<Item = usize> + 'a {
        let own = self.of.iter().chain(&self.datum).copied();
        let plane = |at: usize| features.get(at).and_then(|feature| feature.plane);
        own.flat_map(move |at| plane(at).into_iter().chain([at]))
    }

    /// Whether its kind measures such features.
    fn fits(&self, features: &[Feature]) -> bool {
        let facts = self.measure.facts();
        let fits = |(kinds, at): (&&[FeatureKind], &usize)| {
            let feature = features.get(*at);
            feature.is_some_and(|feature| kinds.contains(&feature.kind))
        };
        let takes = facts.takes;
        let kinds = |of: &[usize]| -> Vec<FeatureKind> {
            of.iter()
                .filter_map(|&at| features.get(at))
                .map(|of| of.kind)
                .collect()
        };
        takes.len() == self.of.len()
            && takes.iter().zip(&self.of).all(fits)
            && self.datum.iter().all(|&at| at < features.len())
            && self.measure.measures(&kinds(&self.of))
            && (self.datum.is_empty() || makes_datum(&kinds(&self.datum)))
            && self.needs(features).all(|at| {
                let plane = features[at].plane.and_then(|plane| features.get(plane));
                features[at].plane.is_none()
                    || plane.is_some_and(|of| of.kind == FeatureKind::Plane)
            })
    }
}

/// Gauges that a recipe may have.
pub const MAX_GAUGES: usize = 64;

/// Features that a recipe may have.
pub const MAX_FEATURES: usize = 96;

/// Most cells of the gauges of a plan, where gauges that look at the same pixels share them. Each takes
/// 112 bytes per sequence, and its sums 16 bytes in each strip of rows.
const MAX_CELLS: usize = 1 << 17;

/// Gauges that cannot be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unmeasurable {
    /// More than [`MAX_GAUGES`].
    #[error("{gauges} gauges where at most {MAX_GAUGES} are measured")]
    TooMany {
        /// How many.
        gauges: usize,
    },
    /// More than [`MAX_FEATURES`].
    #[error("{features} features where at most {MAX_FEATURES} are found")]
    TooManyFeatures {
        /// How many.
        features: usize,
    },
    /// A gauge whose kind does not measure such features.
    #[error("gauge {} is of features that its kind does not measure", gauge + 1)]
    Unfit {
        /// Which gauge.
        gauge: usize,
    },
    /// A section that golden does not see.
    #[error("golden does not see feature {}, a section", feature + 1)]
    NoSection {
        /// Which feature.
        feature: usize,
    },
    /// A contour that golden does not have.
    #[error("golden has no contour in the region of feature {}", feature + 1)]
    NoContour {
        /// Which feature.
        feature: usize,
    },
    /// A contour where a level has two shifts.
    #[error("a contour needs three shifts or more, for feature {}", feature + 1)]
    NoQuadrature {
        /// Which feature.
        feature: usize,
    },
    /// A smoothing over so many pixels that sums of heights over them could overflow.
    #[error("a smoothing over {side}x{side} pixels is too wide for the working range")]
    TooSmooth {
        /// Side of the square in pixels.
        side: usize,
    },
    /// More cells than are kept.
    #[error("{0}")]
    TooFine(TooFine),
    /// All gauges together have too many cells.
    #[error(
        "the gauges divide their regions into {cells} squares or more, at most {MAX_CELLS} are kept: smooth over more pixels, or let gauges share a feature"
    )]
    TooManyCells {
        /// How many there would be, with those of the gauge that is one too many.
        cells: usize,
    },
}

/// The cells of a feature's region, of one side. All gauges that ask for them share them.
#[derive(Debug)]
pub struct Patch {
    /// Which of the features.
    pub feature: usize,
    /// The side that was asked for; 0 where the grid has chosen one.
    side: usize,
    pub grid: Grid,
    pub taught: Vec<TaughtCell>,
}

impl Patch {
    /// Its cells' pixels as taught.
    pub fn pixels(&self) -> u32 {
        self.taught.iter().map(|cell| cell.pixels).sum()
    }

    /// The mean variance of a pixel as taught, in height or along the normal, mm².
    pub fn pixel_variance(&self, along_normal: bool) -> f64 {
        let variances = self.taught.iter().map(|cell| match along_normal {
            true => cell.along_normal().variance,
            false => cell.variance,
        });
        let sum: f64 = variances.sum();
        sum / f64::from(self.pixels().max(1))
    }
}

/// The squares of one side that a gauge of deviation looks at.
#[derive(Clone, Copy, Debug)]
pub struct SquaresOf {
    /// Which gauge.
    pub gauge: usize,
    /// The side of its squares where it may be the smallest.
    pub smallest: usize,
    pub side: usize,
    /// Whether there are places with squares of another side.
    pub partly: bool,
}

/// A side of squares, and where there are some of this side: the box around their middles.
#[derive(Clone, Debug)]
pub struct SquareSide {
    pub side: usize,
    pub rows: Range<usize>,
    pub columns: Range<usize>,
}

impl SquareSide {
    /// The rows or columns that squares about the middles reach, of a frame with any.
    pub fn reached(&self, middles: &Range<usize>) -> Range<usize> {
        let half = self.side / 2;
        middles.start.saturating_sub(half)..middles.end + half
    }

    /// Includes another box.
    fn widen(&mut self, rows: Range<usize>, columns: Range<usize>) {
        self.rows = hull(self.rows.clone(), rows);
        self.columns = hull(self.columns.clone(), columns);
    }
}

/// All gauges, and what was planned of them.
#[derive(Debug)]
pub struct Gauges {
    pub list: Vec<Gauge>,
    /// One per feature; empty where no gauge is of the feature.
    pub regions: Vec<Region>,
    /// The cells of all gauges that are worked out from cells.
    pub patches: Vec<Patch>,
    /// Per gauge its patches, in the order of its features; none if it has no cells.
    pub patches_of: Vec<Vec<usize>>,
    /// The patches that planes are fitted to, each of another feature.
    pub planes: Vec<usize>,
    /// The contours, each with the place of its plane among the planes.
    pub contours: Vec<(usize, usize)>,
    /// The sections.
    pub sections: Vec<usize>,
    /// The gauges of pixels.
    pub coverages: Vec<usize>,
    /// The squares of all gauges of deviation, gauge by gauge.
    pub squares: Vec<SquaresOf>,
    /// The sides of these squares, each once.
    pub sides: Vec<SquareSide>,
    /// What the uncertainty of a coverage follows from.
    pub threshold: Threshold,
}

impl Gauges {
    /// Plans gauges of features. Deviations are at most `span_nm`; the motion of a part turns it as
    /// `alignment` says.
    pub fn new(
        features: &[Feature],
        list: Vec<Gauge>,
        golden: GoldenSurface<'_>,
        alignment: Option<&Alignment>,
        span_nm: f64,
        threshold: Threshold,
    ) -> Result<Self, Unmeasurable> {
        if list.len() > MAX_GAUGES {
            let gauges = list.len();
            return Err(Unmeasurable::TooMany { gauges });
        }
        if features.len() > MAX_FEATURES {
            let features = features.len();
            return Err(Unmeasurable::TooManyFeatures { features });
        }
        if let Some(gauge) = list.iter().position(|gauge| !gauge.fits(features)) {
            return Err(Unmeasurable::Unfit { gauge });
        }
        let (mut squares, mut sides) = (Vec::new(), Vec::new());
        for (at, gauge) in list.iter().enumerate() {
            let Some(smallest) = gauge.measure.facts().basis.square_side() else {
                continue;
            };
            let all = golden.taught.sides(smallest);
            for &side in &all {
                if !extreme::fits(side, span_nm) {
                    return Err(Unmeasurable::TooSmooth { side });
                }
                let partly = all.len() > 1;
                squares.push(SquaresOf {
                    gauge: at,
                    smallest,
                    side,
                    partly,
                });
                let known = sides
                    .iter()
                    .position(|known: &SquareSide| known.side == side);
                let known = known.unwrap_or_else(|| {
                    sides.push(SquareSide {
                        side,
                        rows: 0..0,
                        columns: 0..0,
                    });
                    sides.len() - 1
                });
                let size = (golden.surface.width, golden.surface.height.len());
                let own = |place: &usize| golden.taught.side(*place, smallest) == side;
                match partly {
                    true => (0..size.1).filter(own).for_each(|place| {
                        let (row, column) = (place / size.0, place % size.0);
                        sides[known].widen(row..row + 1, column..column + 1);
                    }),
                    false => sides[known].widen(0..size.1 / size.0.max(1), 0..size.0),
                }
            }
        }
        let about = alignment.map_or((Vector::default(), 1.0), |a| (a.centre, a.radius));
        let used = |at: usize| {
            list.iter()
                .any(|gauge| gauge.needs(features).any(|of| of == at))
        };
        let regions = features
            .iter()
            .enumerate()
            .map(|(at, feature)| match used(at) {
                true => feature.region.clone(),
                false => Region::default(),
            });
        let regions: Vec<Region> = regions.collect();
        let (mut patches, mut cells) = (Vec::<Patch>::new(), 0);
        let mut patch_of = |feature: usize, side: usize| {
            let shows = |feature: usize| {
                let kind = features[feature].kind;
                (kind == FeatureKind::Surface, kind.is_contour())
            };
            // Gauges of features that look at the same pixels share their cells; a plane's are its
            // own.
            let known = |patch: &Patch| {
                let alike = side > 0
                    && shows(patch.feature) == shows(feature)
                    && regions[patch.feature] == regions[feature];
                patch.side == side && (patch.feature == feature || alike)
            };
            if let Some(patch) = patches.iter().position(known) {
                return Ok(patch);
            }
            let region = &regions[feature];
            let grid = Grid::over(region, side).map_err(Unmeasurable::TooFine)?;
            cells += grid.len();
            if cells > MAX_CELLS {
                return Err(Unmeasurable::TooManyCells { cells });
            }
            let mut taught = taught_cells(&grid, region, golden, about);
            if features[feature].kind != FeatureKind::Surface {
                let highest = features[feature].kind.is_contour();
                keep_face(&mut taught, (&grid, region), golden, highest);
            }
            patches.push(Patch {
                feature,
                side,
                grid,
                taught,
            });
            Ok(patches.len() - 1)
        };
        let (mut patches_of, mut coverages) = (Vec::new(), Vec::new());
        let (mut planes, mut contours) = (Vec::new(), Vec::new());
        for (at, gauge) in list.iter().enumerate() {
            let basis = gauge.measure.facts().basis;
            if basis == Basis::Pixels {
                coverages.push(at);
            }
            let mut own = Vec::new();
            if let Some(side) = basis.cell_side() {
                for &feature in &gauge.of {
                    own.push(patch_of(feature, side)?);
                }
            }
            patches_of.push(own);
            for feature in gauge.needs(features) {
                let of = &features[feature];
                if of.kind == FeatureKind::Plane || of.kind.is_contour() && of.plane.is_none() {
                    let patch = patch_of(feature, 0)?;
                    if !planes.contains(&patch) {
                        planes.push(patch);
                    }
                }
            }
        }
        for (at, feature) in features.iter().enumerate() {
            if feature.kind.is_contour() && used(at) {
                let plane = feature.plane.unwrap_or(at);
                let plane = planes
                    .iter()
                    .position(|&patch| patches[patch].feature == plane);
                contours.extend(plane.map(|plane| (at, plane)));
            }
        }
        let is_section = |at: &usize| features[*at].kind == FeatureKind::Section && used(*at);
        Ok(Self {
            sections: (0..features.len()).filter(is_section).collect(),
            list,
            regions,
            patches,
            patches_of,
            planes,
            contours,
            coverages,
            squares,
            sides,
            threshold,
        })
    }

    /// The region of a gauge of one feature, as taught or as the part lies.
    pub fn region<'a>(&'a self, pose: &'a PoseField, gauge: usize) -> Option<&'a Region> {
        let feature = *self.list.get(gauge)?.of.first()?;
        Some(pose.region(&self.regions, feature))
    }

    /// Bytes of cells and regions: nearly all of its memory.
    pub fn bytes(&self) -> usize {
        let cells = self.patches.iter().map(|patch| size_of_val(&*patch.taught));
        let regions = self.regions.iter().map(Region::bytes);
        cells.chain(regions).sum()
    }

    /// The largest side of a square; none if there is no deviation.
    pub fn largest_side(&self) -> Option<usize> {
        self.sides.iter().map(|of| of.side).max()
    }
}
