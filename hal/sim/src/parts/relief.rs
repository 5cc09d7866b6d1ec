//! Free-form surfaces as sums of smooth swells: a face, and the base of a telephone's handset.
//!
//! A swell of height h about a segment is h · s(t) with s(t) = t³(10 − 15t + 6t²) and t = (reach −
//! d) / (reach − flat), clamped to 0…1, where d is the distance from the segment: a plateau up to
//! `flat`, and nothing beyond `reach`. With w = reach − flat its slope is at most 1.875 |h| / w;
//! its second derivative is at most 10/√3 |h| / w² along d, and at most 40/9 |h| / w² across it.

use serde::{Deserialize, Serialize};

use super::Defect;
use crate::optics::Vector;
use crate::trace::Surface;

/// Distance of the points at which slopes and heights are computed to bound them, mm.
const GRID_MM: f64 = 0.5;
/// Side of the squares for which the swells near them are known, mm.
const CELL_MM: f64 = 5.0;
/// z of the foot of the face's oval, and how far its material reaches, mm.
const FACE_BASE: f64 = -37.0;
const FACE_RIM: f64 = 68.0;
/// z of the foot of the handset's shell, and how far its material reaches, mm.
const HANDSET_BASE: f64 = -16.0;
const HANDSET_RIM: f64 = 42.0;

/// The face, and its dents: the subject of the paper's Fig. 18, in a design of this project.
///
/// 136 mm wide, 192 mm high and 75 mm deep, in front of z = 0 by half of that: forehead, brows, eyes
/// in their sockets, nose, cheeks, lips and chin on an oval. Its steepest places are the flanks of
/// the nose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Face {
    /// Dents; a good part has none.
    pub defects: Vec<Defect>,
}

/// The base of a telephone's handset, and its dents: the subject of the paper's Fig. 19, in a design
/// of this project.
///
/// 84 mm wide, 196 mm long along y and 30 mm deep, about z = 0: a rounded shell with an ear piece and
/// a mouth piece, the cradle's hollow between them, a ridge along the grip, and flat panels, each a
/// plateau with smooth flanks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Handset {
    /// Dents; a good part has none.
    pub defects: Vec<Defect>,
}

/// An elevation, or a hollow where the height is negative, about a straight line; mm.
#[derive(Clone, Copy)]
pub(super) struct Swell {
    ends: [[f64; 2]; 2],
    flat: f64,
    reach: f64,
    height: f64,
}

impl Swell {
    /// A swell about the segment between two points.
    pub fn along(ends: [[f64; 2]; 2], [flat, reach]: [f64; 2], height: f64) -> Self {
        Self {
            ends,
            flat,
            reach,
            height,
        }
    }

    /// A swell about a point.
    pub fn round(at: [f64; 2], [flat, reach]: [f64; 2], height: f64) -> Self {
        Self::along([at, at], [flat, reach], height)
    }

    /// The swell mirrored at x = 0.
    pub fn mirrored(&self) -> Self {
        Self {
            ends: self.ends.map(|[x, y]| [-x, y]),
            ..*self
        }
    }

    /// The lowest and highest coordinate of its segment along an axis.
    fn ends_along(&self, axis: usize) -> [f64; 2] {
        let [from, to] = self.ends.map(|end| end[axis]);
        [from.min(to), from.max(to)]
    }

    /// Whether (x, y) is in the box about everything within `reach` of the segment.
    fn has_near(&self, x: f64, y: f64, reach: f64) -> bool {
        let [[left, right], [bottom, top]] = [0, 1].map(|axis| self.ends_along(axis));
        x > left - reach && x < right + reach && y > bottom - reach && y < top + reach
    }

    /// The vector from the nearest point of the segment to (x, y).
    fn off(&self, x: f64, y: f64) -> [f64; 2] {
        let [[from_x, from_y], [to_x, to_y]] = self.ends;
        let [dx, dy] = [to_x - from_x, to_y - from_y];
        let (x, y) = (x - from_x, y - from_y);
        let length = dx * dx + dy * dy;
        let share = match length > 0.0 {
            true => ((x * dx + y * dy) / length).clamp(0.0, 1.0),
            false => 0.0,
        };
        [x - share * dx, y - share * dy]
    }

    /// t at a square of the distance, and that distance; none where the swell has ended. Most
    /// points are there, and are spared the square root.
    fn share(&self, squared: f64) -> Option<(f64, f64)> {
        if squared >= self.reach * self.reach {
            return None;
        }
        let distance = squared.sqrt();
        let t = (self.reach - distance) / (self.reach - self.flat);
        Some((t.min(1.0), distance))
    }

    fn z(&self, x: f64, y: f64) -> f64 {
        let [x, y] = self.off(x, y);
        let rise = |(t, _): (f64, f64)| self.height * t * t * t * (10.0 + t * (6.0 * t - 15.0));
        self.share(x * x + y * y).map_or(0.0, rise)
    }

    /// The slopes along x and y.
    fn slopes(&self, x: f64, y: f64) -> [f64; 2] {
        let [x, y] = self.off(x, y);
        let Some((t, distance)) = self.share(x * x + y * y) else {
            return [0.0; 2];
        };
        let falling = self.height * 30.0 * (t * (1.0 - t)).powi(2) / (self.reach - self.flat);
        let per_mm = -falling / distance.max(f64::MIN_POSITIVE);
        [x * per_mm, y * per_mm]
    }

    /// The largest second derivative.
    fn curvature(&self) -> f64 {
        5.774 * self.height.abs() / (self.reach - self.flat).powi(2)
    }
}

/// The surface: the sum of the swells, and its material.
pub(super) struct Relief {
    swells: Vec<Swell>,
    /// z without any swell.
    base: f64,
    /// Largest distance of material from the first swell's segment.
    rim: f64,
    slope: f64,
    bounds: [Vector; 2],
    /// Lowest x and y of the cells, how many there are along x, and for each of them, row by row,
    /// the swells that rise in it, as bits: a point is near few of all swells.
    corner: [f64; 2],
    columns: usize,
    cells: Vec<u32>,
}

impl Relief {
    /// The surface of these swells, at most 32, whose first one makes the outline at the distance
    /// `rim`.
    pub fn new(swells: Vec<Swell>, base: f64, rim: f64) -> Self {
        let mut relief = Self {
            swells,
            base,
            rim,
            slope: 0.0,
            bounds: [[0.0; 3]; 2],
            corner: [0.0; 2],
            columns: 0,
            cells: Vec::new(),
        };
        let ends = [0, 1].map(|axis| relief.ends(axis));
        relief.sort(ends);
        relief.measure(ends);
        relief
    }

    /// The lowest and highest coordinate along an axis at which a swell rises.
    fn ends(&self, axis: usize) -> [f64; 2] {
        let all = self.swells.iter().map(|swell| {
            let [low, high] = swell.ends_along(axis);
            [low - swell.reach, high + swell.reach]
        });
        let wider = |[low, high]: [f64; 2], [l, h]: [f64; 2]| [low.min(l), high.max(h)];
        all.fold([0.0; 2], wider)
    }

    /// Finds the swells near each cell.
    fn sort(&mut self, [[left, right], [bottom, top]]: [[f64; 2]; 2]) {
        let count = |from: f64, to: f64| ((to - from) / CELL_MM).floor() as usize + 1;
        self.corner = [left, bottom];
        self.columns = count(left, right);
        let half = CELL_MM / 2.0 + 1e-6;
        let near = |at: usize| {
            let x = left + CELL_MM * ((at % self.columns) as f64 + 0.5);
            let y = bottom + CELL_MM * ((at / self.columns) as f64 + 0.5);
            let bits = (0_u32..).zip(&self.swells);
            bits.filter(|(_, swell)| swell.has_near(x, y, swell.reach + half))
                .fold(0, |all, (bit, _)| all | 1 << bit)
        };
        self.cells = (0..self.columns * count(bottom, top)).map(near).collect();
    }

    /// Bounds slopes and heights by those on a grid, no point being farther than half its diagonal
    /// from one of the grid: slopes change over this distance by at most the curvature times the
    /// distance, heights by the slope times the distance.
    fn measure(&mut self, [[left, right], [bottom, top]]: [[f64; 2]; 2]) {
        let half = GRID_MM * std::f64::consts::FRAC_1_SQRT_2;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let count = |from: f64, to: f64| ((to - from) / GRID_MM).ceil() as u32;
        for row in 0..=count(bottom, top) {
            for column in 0..=count(left, right) {
                let x = left + GRID_MM * f64::from(column);
                let y = bottom + GRID_MM * f64::from(row);
                let (mut slopes, mut curvature) = ([0.0; 2], 0.0);
                let near = |swell: &&Swell| swell.has_near(x, y, swell.reach + half);
                for swell in self.swells.iter().filter(near) {
                    let [along_x, along_y] = swell.slopes(x, y);
                    slopes = [slopes[0] + along_x, slopes[1] + along_y];
                    curvature += swell.curvature();
                }
                let slope = slopes[0].hypot(slopes[1]) + half * curvature;
                self.slope = self.slope.max(slope);
                let z = self.height(x, y);
                (low, high) = (low.min(z), high.max(z));
            }
        }
        let Some(outline) = self.swells.first() else {
            return;
        };
        let [[x0, x1], [y0, y1]] = [0, 1].map(|axis| outline.ends_along(axis));
        let off = half * self.slope;
        self.bounds = [
            [x0 - self.rim, y0 - self.rim, low - off],
            [x1 + self.rim, y1 + self.rim, high + off],
        ];
    }
}

impl Surface for Relief {
    fn height(&self, x: f64, y: f64) -> f64 {
        let [column, row] = [x - self.corner[0], y - self.corner[1]].map(|off| off / CELL_MM);
        if column < 0.0 || row < 0.0 || column >= self.columns as f64 {
            return self.base;
        }
        let cell = row as usize * self.columns + column as usize;
        let mut left = self.cells.get(cell).copied().unwrap_or(0);
        let mut z = self.base;
        while left != 0 {
            let swell = self.swells.get(left.trailing_zeros() as usize);
            z += swell.map_or(0.0, |swell| swell.z(x, y));
            left &= left - 1;
        }
        z
    }

    fn present(&self, x: f64, y: f64) -> bool {
        let outline = self.swells.first();
        outline.is_some_and(|swell| {
            let [x, y] = swell.off(x, y);
            x.hypot(y) <= self.rim
        })
    }

    fn slope_bound(&self) -> f64 {
        self.slope
    }

    fn bounds(&self) -> [Vector; 2] {
        self.bounds
    }
}

impl Face {
    /// The surface of a good face.
    pub(super) fn surface() -> Relief {
        let middle = [
            // The oval, first: its outline.
            Swell::along([[0.0, -26.0], [0.0, 28.0]], [0.0, 84.0], 46.0),
            // Forehead.
            Swell::along([[-14.0, 60.0], [14.0, 60.0]], [0.0, 50.0], 6.0),
            // Nose: its root, bridge and tip.
            Swell::along([[0.0, 40.0], [0.0, -8.0]], [0.0, 24.0], 8.0),
            Swell::along([[0.0, 14.0], [0.0, -15.0]], [0.0, 19.0], 8.5),
            Swell::round([0.0, -15.5], [0.0, 17.0], 7.5),
            // Mouth: its swelling, the lips, and the line between them.
            Swell::along([[-9.0, -47.0], [9.0, -47.0]], [0.0, 32.0], 6.0),
            Swell::along([[-12.0, -43.0], [0.0, -41.0]], [0.0, 9.0], 2.0),
            Swell::along([[12.0, -43.0], [0.0, -41.0]], [0.0, 9.0], 2.0),
            Swell::along([[-9.0, -52.0], [9.0, -52.0]], [0.0, 10.5], 4.2),
            Swell::along([[-18.0, -46.0], [18.0, -46.0]], [0.0, 5.5], -2.2),
            // Philtrum, the hollow below the lips, and the chin.
            Swell::along([[0.0, -28.0], [0.0, -36.0]], [0.0, 6.5], -1.2),
            Swell::along([[-8.0, -62.0], [8.0, -62.0]], [0.0, 13.0], -3.2),
            Swell::along([[-6.0, -77.0], [6.0, -77.0]], [0.0, 27.0], 11.0),
        ];
        let right = [
            // Brow, eye socket and eye.
            Swell::along([[10.0, 34.0], [38.0, 33.0]], [0.0, 19.0], 5.5),
            Swell::along([[21.0, 17.0], [33.0, 16.0]], [0.0, 21.0], -10.0),
            Swell::along([[24.0, 16.0], [31.0, 15.5]], [0.0, 13.0], 6.0),
            // The fold of the lid, the wing of the nose, and the cheekbone.
            Swell::along([[17.0, 22.0], [36.0, 21.5]], [0.0, 6.0], -1.2),
            Swell::along([[8.0, -17.0], [9.5, -19.0]], [0.0, 12.0], 5.5),
            Swell::along([[36.0, -4.0], [46.0, 4.0]], [0.0, 38.0], 8.0),
            // The hollow of the cheek, the fold from the nose to the mouth, and the corner of the
            // mouth.
            Swell::along([[48.0, -38.0], [40.0, -56.0]], [0.0, 34.0], -4.5),
            Swell::along([[17.0, -22.0], [27.0, -42.0]], [0.0, 11.0], -2.2),
            Swell::round([21.0, -46.0], [0.0, 10.0], -1.8),
        ];
        let left: Vec<Swell> = right.iter().map(Swell::mirrored).collect();
        let swells = middle.into_iter().chain(right).chain(left);
        Relief::new(swells.collect(), FACE_BASE, FACE_RIM)
    }
}

impl Handset {
    /// The surface of a good handset.
    pub(super) fn surface() -> Relief {
        let swells = vec![
            // The shell, first: its outline.
            Swell::along([[0.0, -56.0], [0.0, 56.0]], [24.0, 46.0], 17.0),
            // The cradle's hollow across the grip.
            Swell::along([[-60.0, 0.0], [60.0, 0.0]], [12.0, 40.0], -7.0),
            // Ear piece: a raised disc with a dish.
            Swell::round([0.0, 60.0], [22.0, 31.0], 7.0),
            Swell::round([0.0, 60.0], [4.0, 19.0], -4.5),
            // Mouth piece: a lower disc, with a flat panel in it and a boss on that.
            Swell::round([0.0, -60.0], [20.0, 30.0], 5.5),
            Swell::round([0.0, -60.0], [13.0, 17.0], -2.0),
            Swell::round([0.0, -60.0], [3.0, 8.0], 2.5),
            // A ridge along the grip, and a flat panel on either side of it.
            Swell::along([[0.0, -22.0], [0.0, 22.0]], [1.0, 7.0], 3.0),
            Swell::along([[17.0, -14.0], [17.0, 14.0]], [6.0, 8.0], -1.2),
            Swell::along([[-17.0, -14.0], [-17.0, 14.0]], [6.0, 8.0], -1.2),
        ];
        Relief::new(swells, HANDSET_BASE, HANDSET_RIM)
    }
}
