//! The golden part as the camera sees it: what all stages count heights from and compare with.

use super::ground::Ground;
use crate::geometry::{Solution, Triangulator, Vector};
use crate::inspect::align::{Alignment, GoldenSurface, Placed};
use crate::inspect::taught::Taught;
use crate::pipeline::{HeightCubics, Window};
use crate::units::{AbsolutePhase, Height};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;

/// The part as taught, with the camera's geometry.
#[derive(Debug)]
pub struct Golden {
    pub triangulator: Arc<Triangulator>,
    /// Its surface, and how phases become heights about it.
    pub cubics: Arc<HeightCubics>,
    /// Φ₀ that phases are unwrapped about, where it is not that of the cubics.
    map: Option<Vec<AbsolutePhase>>,
    pub taught: Taught,
    /// Columns of each row that are looked at.
    pub window: Vec<Range<usize>>,
    /// Pixels inside the window that are compared.
    pub compared: u64,
    /// The middle of its heights and half their span, mm.
    pub levels: (f64, f64),
    /// What it lies on; `None` where nothing else is seen.
    pub ground: Option<Ground>,
}

impl Golden {
    pub fn new(
        triangulator: Arc<Triangulator>,
        cubics: Arc<HeightCubics>,
        map: Option<Vec<AbsolutePhase>>,
        mut taught: Taught,
        window: Vec<Range<usize>>,
        ground: Option<([f64; 3], f64)>,
    ) -> Self {
        let width = cubics.surface().width;
        taught.mark_squares(width.max(1));
        let compared = window.iter().enumerate().map(|(v, columns)| {
            let row = v * width + columns.start..v * width + columns.end;
            row.filter(|&place| taught.compared(place)).count() as u64
        });
        Self {
            compared: compared.sum(),
            levels: levels(&cubics.surface().height, width, &window),
            ground: ground.map(|(plane, period)| {
                Ground::new(&triangulator, plane, (width, window.len()), period)
            }),
            triangulator,
            cubics,
            map,
            taught,
            window,
        }
    }

    /// Whether a place is surely of the part: where it is compared. Beside what it lies on it ends as far before
    /// its rim as it is compared otherwise, and more of it may not be compared.
    pub fn is_part(&self, place: usize) -> bool {
        match &self.ground {
            Some(_) => self.taught.is_seen(place),
            None => self.taught.compared(place),
        }
    }

    /// Columns and rows of the frame.
    pub fn size(&self) -> (usize, usize) {
        (self.cubics.surface().width, self.window.len())
    }

    /// The map that phases are unwrapped about, row-major.
    pub fn map(&self) -> &[AbsolutePhase] {
        self.map.as_ref().unwrap_or(&self.cubics.surface().phase)
    }

    /// Its surface as parts are aligned with it.
    pub fn surface(&self) -> GoldenSurface<'_> {
        GoldenSurface {
            triangulator: &self.triangulator,
            surface: self.cubics.surface(),
            taught: &self.taught,
        }
    }

    /// The point at height `z` that pixel (u, v) sees.
    pub fn seen(&self, u: usize, v: usize, z: f64) -> Option<Vector> {
        self.triangulator.point(u, v, Height::from_mm(z))
    }

    /// The pixel nearest to a place, and the point of golden that it sees.
    pub fn nearest(&self, place: [f64; 2]) -> ((usize, usize), Option<Vector>) {
        let (width, rows) = self.size();
        // Casts keep to the range of their type.
        let near =
            |at: f64, end: usize| (libm::rint(at.max(0.0)) as usize).min(end.saturating_sub(1));
        let (u, v) = (near(place[0], width), near(place[1], rows));
        let seen = self.seen(u, v, self.height_mm(v * width + u));
        ((u, v), seen)
    }

    /// Its height at a place, mm; the middle one where that is not known.
    pub fn height_mm(&self, place: usize) -> f64 {
        let height = self.cubics.surface().height[place];
        match height.is_known() {
            true => height.mm(),
            false => self.levels.0,
        }
    }

    /// What a pixel in the middle of the frame sees of a surface at the middle height, mm.
    pub fn pixel_mm(&self) -> f64 {
        let (width, rows) = self.size();
        let sees = |u: usize| self.seen(u, rows / 2, self.levels.0);
        let pixel = sees(width / 2).zip(sees(width / 2 + 1));
        pixel.map_or(0.0, |(one, next)| (next - one).length())
    }

    /// The exact height of a phase. Where it is not near golden's, what the part lies on is tried first: most of such
    /// pixels see that.
    pub fn solve(&self, (u, v): (usize, usize), phase: AbsolutePhase) -> Option<Solution> {
        let (column, row) = (u as f64, v as f64);
        let place = v * self.size().0 + u;
        let near = self.cubics.near(place, phase);
        let on_ground = || {
            Some(
                self.ground
                    .as_ref()?
                    .seen(&self.triangulator, column, row)?
                    .z,
            )
        };
        match near.or_else(on_ground) {
            Some(near) => self
                .triangulator
                .solve_near(column, row, phase.turns(), near),
            None => self.triangulator.solve(column, row, phase.turns()),
        }
    }

    /// ∂z/∂Φ in mm per turn.
    pub fn slope(&self, (u, v): (usize, usize), phase: AbsolutePhase) -> f64 {
        let place = v * self.size().0 + u;
        self.cubics.slope(place, phase).unwrap_or_else(|| {
            self.solve((u, v), phase)
                .map_or(0.0, |solution| 1.0 / solution.slope)
        })
    }

    /// The Jacobian, over the motion, of the height of what a pixel sees `offset_nm` above golden;
    /// none where the surface there has no facet.
    pub fn lift(
        &self,
        alignment: &Alignment,
        placed: &Placed,
        (u, v): (usize, usize),
        offset_nm: i32,
    ) -> Option<[f64; 6]> {
        let base = base_nm(self.cubics.surface().height[v * self.size().0 + u]);
        let height = Height::from_nm(base.saturating_add(offset_nm));
        let point = placed.motion.undo(self.triangulator.point(u, v, height)?);
        let seen = self.triangulator.camera().project(point)?;
        let facet = self.surface().facet(point, seen)?;
        Some(facet.jacobian(point, (alignment.centre, alignment.radius)))
    }
}

/// z₀ that offsets count from: golden's height, 0 where that is not known.
#[inline]
pub fn base_nm(golden: Height) -> i32 {
    if golden.is_known() { golden.nm() } else { 0 }
}

/// The middle and half the span of the known heights inside a window, mm.
fn levels(heights: &[Height], width: usize, window: Window<'_>) -> (f64, f64) {
    let (mut low, mut high) = (i32::MAX, i32::MIN);
    for (v, columns) in window.iter().enumerate() {
        for height in &heights[v * width + columns.start..v * width + columns.end] {
            if height.is_known() {
                (low, high) = (low.min(height.nm()), high.max(height.nm()));
            }
        }
    }
    if low > high {
        return (0.0, 1.0);
    }
    let (low, high) = (f64::from(low) * 1e-6, f64::from(high) * 1e-6);
    ((low + high) / 2.0, ((high - low) / 2.0).max(1.0))
}
