//! Where a contour lies on golden, to about two pixels: from golden's heights.
//!
//! A pixel of the region belongs to the face if golden has a certain height there, near the plane.
//! What does not is the opening, with an edge of [`ERODED_PX`] around, where heights are not
//! certain.

use super::face::Face;
use crate::geometry::Vector;
use crate::inspect::contour::PlaneView;
use crate::inspect::contour::shape::{Outline, PlanePlace, Trace, mean};
use crate::inspect::feature::{FeatureKind, PlaneFrame};
use crate::inspect::mask::components;
use crate::inspect::region::Region;
use crate::inspect::strips::golden::Golden;
use alloc::vec;
use alloc::vec::Vec;

/// A surface within this distance of the plane is its face, mm.
const NEAR_MM: f64 = 0.3;
/// Pixels next to an edge whose heights are not certain.
const ERODED_PX: f64 = 2.5;
/// An opening has at least so many pixels.
const LEAST_PIXELS: usize = 9;
/// A floor is seen in at least this share of an opening's pixels, unless half of those that see
/// something lie within [`NEAR_MM`]: of a small opening it may be a shadow that leaves few.
const FLOOR_SHARE: f64 = 0.2;

/// What golden's heights say of a contour.
#[derive(Clone, Debug)]
pub struct Traced {
    pub outline: Outline,
    /// Places of the frame that see the face.
    pub face: Vec<usize>,
    /// How far below the plane a floor lies, mm, if golden has one or lies on one.
    pub floor: Option<f64>,
}

/// The pixels of a region over the box around it.
struct RegionPixels {
    left: usize,
    top: usize,
    width: usize,
    /// Row-major: the distance above the plane; NaN where it is not known, `None` outside of the
    /// region.
    above: Vec<Option<f64>>,
}

/// Finds a contour of this kind in a region of golden; `None` if there is none.
pub fn trace(
    kind: FeatureKind,
    region: &Region,
    golden: &Golden,
    face: &Face<'_>,
) -> Option<Traced> {
    let pixels = RegionPixels::of(region, golden, face);
    let spot = |at: usize| {
        let (u, v) = pixels.place(at);
        face.spot(u as f64, v as f64).map(|spot| (spot.x, spot.y))
    };
    let middle = (0..pixels.above.len()).find(|&at| pixels.is_face(at))?;
    let (here, (u, v)) = (spot(middle)?, pixels.place(middle));
    let beside = face.spot(u as f64 + 1.0, v as f64)?;
    let pixel = libm::hypot(beside.x - here.0, beside.y - here.1);
    let all = 0..pixels.above.len();
    let opening = match kind.is_opening() {
        true => pixels.opening()?,
        false => all.clone().filter(|&at| pixels.is_open(at)).collect(),
    };
    if opening.len() < LEAST_PIXELS {
        return None;
    }
    let on_face = all.filter(|&at| pixels.is_face(at));
    let trace = Trace {
        places: match kind.is_opening() {
            true => hull(opening.iter().copied().filter_map(spot).collect()),
            false => {
                let edge = on_face.clone().filter(|&at| pixels.is_edge(at));
                edge.filter_map(spot).collect()
            }
        },
        face: mean(on_face.clone().filter_map(spot))?,
        eroded: ERODED_PX * pixel,
    };
    let outline = (kind.contour()?.begin)(&trace)?;
    let depths = opening.iter().filter_map(|&at| pixels.above[at]);
    let mut depths: Vec<f64> = depths.filter(|above| *above < -NEAR_MM).collect();
    depths.sort_unstable_by(f64::total_cmp);
    let count = depths.len();
    let floor = depths.get(count / 2).map(|above| -above);
    let is_seen = count as f64 >= FLOOR_SHARE * opening.len() as f64
        || count >= LEAST_PIXELS && depths[count * 3 / 4] - depths[count / 4] < NEAR_MM;
    let ground = || ground_below(golden, &face.frame).filter(|depth| *depth > NEAR_MM);
    let width = golden.size().0;
    Some(Traced {
        outline,
        face: on_face
            .map(|at| pixels.place(at))
            .map(|(u, v)| v * width + u)
            .collect(),
        floor: floor.filter(|_| is_seen).or_else(ground),
    })
}

/// How far below a plane that lies so the part's ground is, mm.
pub fn ground_below(golden: &Golden, frame: &PlaneFrame) -> Option<f64> {
    let ground = golden.ground.as_ref()?.at(frame.origin);
    Some(frame.normal().dot(frame.origin - ground))
}

impl RegionPixels {
    fn of(region: &Region, golden: &Golden, face: &Face<'_>) -> Self {
        let (columns, rows) = region.bounds();
        let (left, top, width) = (columns.start, rows.start, columns.len());
        let mut pixels = Self {
            left,
            top,
            width,
            above: vec![None; width * rows.len()],
        };
        let (normal, origin) = (face.frame.normal(), face.frame.origin);
        for (row, span) in region.spans() {
            for u in span.clone() {
                let place = row * golden.size().0 + u;
                let point = golden
                    .is_part(place)
                    .then(|| golden.seen(u, *row, golden.height_mm(place)));
                let above = |point: Vector| normal.dot(point - origin);
                pixels.above[(row - top) * width + u - left] =
                    Some(point.flatten().map_or(f64::NAN, above));
            }
        }
        pixels
    }

    fn place(&self, at: usize) -> (usize, usize) {
        (self.left + at % self.width, self.top + at / self.width)
    }

    fn is_face(&self, at: usize) -> bool {
        self.above[at].is_some_and(|above| libm::fabs(above) < NEAR_MM)
    }

    fn is_open(&self, at: usize) -> bool {
        self.above[at].is_some() && !self.is_face(at)
    }

    /// The four neighbours of a pixel; `None` of those outside of the box.
    fn beside(&self, at: usize) -> [Option<usize>; 4] {
        let (column, rows) = (at % self.width, self.above.len());
        [
            (column > 0).then(|| at - 1),
            (column + 1 < self.width).then_some(at + 1),
            at.checked_sub(self.width),
            (at + self.width < rows).then_some(at + self.width),
        ]
    }

    /// The largest opening that does not touch the border of the region.
    fn opening(&self) -> Option<Vec<usize>> {
        let open: Vec<bool> = (0..self.above.len()).map(|at| self.is_open(at)).collect();
        let in_region = |beside: &Option<usize>| beside.is_some_and(|at| self.above[at].is_some());
        let is_inside = |at: &usize| self.beside(*at).iter().all(in_region);
        let mut openings = components(&open, self.width, false);
        openings.retain(|opening| opening.iter().all(is_inside));
        // Of equal ones the first.
        openings.into_iter().rev().max_by_key(Vec::len)
    }

    /// Whether a pixel of the face lies beside what is none.
    fn is_edge(&self, at: usize) -> bool {
        let open = |beside: &Option<usize>| beside.is_some_and(|beside| self.is_open(beside));
        self.beside(at).iter().any(open)
    }
}

/// The convex hull of points, counterclockwise (A. M. Andrew, Inf. Process. Lett. 9, 1979).
fn hull(mut points: Vec<PlanePlace>) -> Vec<PlanePlace> {
    points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turns_left = |a: (f64, f64), b: (f64, f64), c: (f64, f64)| {
        (b.0 - a.0) * (c.1 - a.1) > (b.1 - a.1) * (c.0 - a.0)
    };
    let half = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut side: Vec<(f64, f64)> = Vec::new();
        for point in points {
            while let [.., before, last] = side[..]
                && !turns_left(before, last, point)
            {
                side.pop();
            }
            side.push(point);
        }
        side.pop();
        side
    };
    let mut lower = half(&mut points.iter().copied());
    lower.extend(half(&mut points.iter().rev().copied()));
    lower
}
