//! What a part lies on: a plane that is seen all round the part and lies behind it.
//!
//! The plane is fitted to the points at the picture's border (trimmed least squares: again and again
//! to the nearer half; P. J. Rousseeuw, 1984). It is what the part lies on if all four sides of the picture
//! show it, if something lies in front of it, and if that begins with a step: the height in front of
//! the plane that is reached at [`NEAR`] pixels from the plane's last pixel is nearly that at twice
//! the distance. A face that rises out of its own base does not step, and a block that fills the
//! picture has nothing in front of it; both are taken for the part as a whole.
//!
//! A pixel beside a step mixes both surfaces, and its height may lie anywhere between them: pixels
//! within [`MARGIN`] of the plane's are left out. That covers the footprint of a pixel and 2 σ of a
//! lens of σ = 0.5 px.
//!
//! Of what is left in front of the plane, pieces that are much smaller than the largest, or that
//! reach the picture's border while a large one does not, are other things, such as pins, clamps or the next
//! part.

use super::mask::{components, eroded};
use crate::geometry::Vector;
use crate::math::solve::Normal;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Width of the border where the plane is looked for, as a share of the picture's shorter side.
const BORDER: f64 = 0.02;
/// Of each side of the border at least this share has a height, and of these heights at least this
/// share belongs to the plane.
const LEAST_KNOWN: f64 = 0.2;
const LEAST_ON_PLANE: f64 = 0.5;
/// Rounds of the trimmed fit, and the share of the points that each of them keeps.
const ROUNDS: usize = 12;
const KEPT: f64 = 0.5;
/// Heights belong to the plane within so many σ of it and this much more, mm.
const SIGMAS: f64 = 5.0;
const ROUGH_MM: f64 = 0.15;
/// Distance from the plane's last pixel at which a step is over, pixels.
const NEAR: isize = 3;
/// Least height at that distance over the height at twice the distance, and least number of places
/// where it is asked.
const STEP: f64 = 0.7;
const LEAST_STEPS: usize = 40;
/// This share of the steps is lower than [`Surroundings::step_mm`].
const LOW: f64 = 0.1;
/// Pixels beside the plane's that are left out.
const MARGIN: usize = 2;
/// Smaller pieces are noise, pixels.
const CRUMB: usize = 20;
/// Pieces smaller than this share of the largest one are other things.
const PIECE: f64 = 0.1;

/// What surrounds a part.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// The pixels of the part, row by row.
    pub part: Vec<bool>,
    /// The part stands out from its surroundings by this much or more, mm.
    pub step_mm: f64,
    /// Share of all pixels that see other things in front of the plane.
    pub others: f64,
}

/// Finds what surrounds a part in a picture of `pixels` pixels with `width` columns. `point` gives the
/// point in mm that a pixel sees, `None` where it has no height; `sigma_mm` is the σ of a height. `None` if
/// no plane is seen all round something that steps out of it.
pub fn surroundings(
    pixels: usize,
    width: usize,
    sigma_mm: f64,
    point: impl Fn(usize) -> Option<Vector>,
) -> Option<Surroundings> {
    let rows = pixels / width.max(1);
    let reach = SIGMAS * sigma_mm + ROUGH_MM;
    let plane = plane(&point, [width, rows], reach)?;
    // Not a number where there is no height.
    let above = |at: usize| point(at).map_or(f64::NAN, |point| plane.above(point)) as f32;
    let above: Vec<f32> = (0..pixels).map(above).collect();
    let apart: Vec<bool> = above
        .iter()
        .map(|above| !(f64::from(*above) <= reach))
        .collect();
    let step_mm = step(&above, &apart, width, reach)?;
    let apart = eroded(&apart, width, MARGIN);
    let front = apart
        .iter()
        .zip(&above)
        .map(|(apart, above)| *apart && !above.is_nan());
    let mut pieces = components(&front.collect::<Vec<_>>(), width, false);
    pieces.retain(|piece| piece.len() >= CRUMB);
    let is_border = |&at: &usize| {
        let (u, v) = (at % width, at / width);
        u <= MARGIN || v <= MARGIN || u + MARGIN + 1 >= width || v + MARGIN + 1 >= rows
    };
    let is_cut = |piece: &Vec<usize>| piece.iter().any(is_border);
    let sizes = |whole: bool| {
        let wanted = pieces.iter().filter(move |piece| !whole || !is_cut(piece));
        wanted.map(Vec::len).max().unwrap_or(0) as f64
    };
    let (whole, largest) = (sizes(true), sizes(false));
    let is_inside = whole >= PIECE * largest;
    let least = PIECE * if is_inside { whole } else { largest };
    let mut part = vec![false; pixels];
    let (mut kept, mut others) = (0, 0);
    for piece in &pieces {
        if (piece.len() as f64) < least || (is_inside && is_cut(piece)) {
            others += piece.len();
            continue;
        }
        kept += piece.len();
        piece.iter().for_each(|&at| part[at] = true);
    }
    (kept > 0).then(|| Surroundings {
        part,
        step_mm,
        others: others as f64 / pixels as f64,
    })
}

/// z = a + b x + c y.
#[derive(Clone, Copy)]
struct Plane([f64; 3]);

impl Plane {
    fn above(self, point: Vector) -> f64 {
        let Self([a, b, c]) = self;
        point.z - (a + b * point.x + c * point.y)
    }

    fn through(points: &[Vector]) -> Option<Self> {
        let rows = points
            .iter()
            .map(|point| ([1.0, point.x, point.y], point.z));
        Normal::of(rows).solve().map(Self)
    }
}

/// The plane that all four sides of a picture show.
fn plane(
    point: &impl Fn(usize) -> Option<Vector>,
    [width, rows]: [usize; 2],
    reach: f64,
) -> Option<Plane> {
    let side = width.min(rows);
    let border = ((BORDER * side as f64) as usize).max(2).min(side);
    let points = |columns: Range<usize>, rows: Range<usize>| {
        let places = rows.flat_map(|v| columns.clone().map(move |u| v * width + u));
        places.map(point).collect::<Vec<_>>()
    };
    let sides = [
        points(0..border, 0..rows),
        points(width - border..width, 0..rows),
        points(0..width, 0..border),
        points(0..width, rows - border..rows),
    ];
    let mut near: Vec<Vector> = sides.iter().flatten().flatten().copied().collect();
    let known = near.clone();
    let mut plane = Plane::through(&near)?;
    for _ in 0..ROUNDS {
        let off = |point: &Vector| plane.above(*point).abs();
        let mut all: Vec<f64> = known.iter().map(off).collect();
        let kept = (KEPT * all.len() as f64) as usize;
        let limit = *all.select_nth_unstable_by(kept, f64::total_cmp).1;
        near.clear();
        near.extend(known.iter().filter(|point| off(point) <= limit));
        plane = Plane::through(&near)?;
    }
    let is_shown = |side: &Vec<Option<Vector>>| {
        let known = side.iter().flatten();
        let on_plane = known
            .clone()
            .filter(|point| plane.above(**point).abs() <= reach);
        let (known, on_plane) = (known.count() as f64, on_plane.count() as f64);
        known >= LEAST_KNOWN * side.len() as f64 && on_plane >= LEAST_ON_PLANE * known
    };
    sides.iter().all(is_shown).then_some(plane)
}

/// How far the lowest places of what lies in front of the plane stand out from it; `None` if that does
/// not begin with a step. `apart` is false for the plane's own pixels.
fn step(above: &[f32], apart: &[bool], width: usize, reach: f64) -> Option<f64> {
    let rows = apart.len() / width.max(1);
    let (mut ratios, mut heights) = (Vec::new(), Vec::new());
    for at in (0..apart.len()).filter(|at| !apart[*at]) {
        let (u, v) = ((at % width) as isize, (at / width) as isize);
        for (right, down) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let beyond = |by: isize| {
                let (u, v) = (u + right * by, v + down * by);
                let inside = u >= 0 && v >= 0 && u < width as isize && v < rows as isize;
                inside.then(|| v as usize * width + u as usize)
            };
            let places = [1, NEAR, 2 * NEAR].map(beyond);
            let [Some(next), Some(near), Some(far)] = places else {
                continue;
            };
            let [near, far] = [near, far].map(|at| f64::from(above[at]));
            if apart[next] && far > reach && !near.is_nan() {
                ratios.push(near / far);
                heights.push(near);
            }
        }
    }
    if heights.len() < LEAST_STEPS {
        return None;
    }
    let share = |values: &mut Vec<f64>, share: f64| {
        let at = (share * values.len() as f64) as usize;
        *values.select_nth_unstable_by(at, f64::total_cmp).1
    };
    (share(&mut ratios, 0.5) >= STEP).then(|| share(&mut heights, LOW))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 120;
    const ROWS: usize = 100;
    const PITCH_MM: f64 = 0.4;

    /// What is found in a picture of these heights, mm, which are not finite where nothing is seen.
    fn found(height: impl Fn(f64, f64) -> f64) -> Option<Surroundings> {
        surroundings(WIDTH * ROWS, WIDTH, 0.02, |at| {
            let (u, v) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
            let z = height(u, v);
            z.is_finite()
                .then(|| Vector::new(u * PITCH_MM, v * PITCH_MM, z))
        })
    }

    fn within(at: f64, [low, high]: [f64; 2]) -> bool {
        (low..=high).contains(&at)
    }

    /// A tilted floor `depth` below a plate of 60 × 50 px with a hole, whose rims are mixed.
    fn plate(depth: f64, u: f64, v: f64) -> f64 {
        let floor = -depth - 0.02 * u * PITCH_MM;
        let hole = (u - 60.0).hypot(v - 50.0);
        let rim = (30.0 - (u - 60.0).abs()).min(25.0 - (v - 50.0).abs());
        let share = (rim.min(hole - 8.0) + 0.5).clamp(0.0, 1.0);
        share * 0.0 + (1.0 - share) * floor
    }

    #[test]
    fn a_plate_is_told_from_the_floor_that_it_touches_or_lies_above() {
        for depth in [1.0, 5.0, 40.0] {
            let found = found(|u, v| plate(depth, u, v)).unwrap();
            assert!(found.step_mm > 0.9 * depth, "{depth}: {}", found.step_mm);
            for (at, part) in found.part.iter().enumerate() {
                let (u, v) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
                let rim = (30.0 - (u - 60.0).abs()).min(25.0 - (v - 50.0).abs());
                let inside = rim.min((u - 60.0).hypot(v - 50.0) - 8.0);
                // The margin is square: up to √2 times as wide across corners of pixels.
                assert!(*part || inside < 4.0, "{depth}: ({u}, {v})");
                assert!(!*part || inside > 1.4, "{depth}: ({u}, {v})");
            }
        }
    }

    #[test]
    fn a_pin_beside_the_part_and_the_next_part_at_the_border_are_other_things() {
        let alone = found(|u, v| plate(10.0, u, v)).unwrap();
        let among = found(|u, v| {
            let pin = (u - 20.0).hypot(v - 30.0) < 5.0;
            if pin || (u > 100.0 && within(v, [30.0, 70.0])) {
                2.0
            } else {
                plate(10.0, u, v)
            }
        })
        .unwrap();
        assert_eq!(alone.part, among.part);
        assert_eq!(alone.others, 0.0);
        assert!((0.04..0.07).contains(&among.others), "{}", among.others);
    }

    #[test]
    fn two_sheets_beside_each_other_are_one_part() {
        let found = found(|u, v| {
            let sheets =
                within(v, [20.0, 80.0]) && (within(u, [20.0, 55.0]) || within(u, [65.0, 100.0]));
            if sheets { 0.0 } else { -12.0 }
        });
        let part = found.unwrap().part;
        assert!(part[50 * WIDTH + 40] && part[50 * WIDTH + 80] && !part[50 * WIDTH + 60]);
    }

    #[test]
    fn where_no_plane_lies_behind_a_step_all_round_everything_is_the_part() {
        let hole = |u: f64, v: f64| (u - 60.0).hypot(v - 50.0) < 20.0;
        assert_eq!(found(|_, _| f64::NAN), None);
        assert_eq!(found(|_, _| 0.0), None);
        // A block with a hole through it, or into it.
        assert_eq!(found(|u, v| if hole(u, v) { f64::NAN } else { 0.0 }), None);
        assert_eq!(found(|u, v| if hole(u, v) { -9.0 } else { 0.0 }), None);
        // A plate in black.
        assert_eq!(found(|u, v| if hole(u, v) { 0.0 } else { f64::NAN }), None);
        // A hill of 45° on its own base.
        let hill = |u: f64, v: f64| (40.0 - (u - 60.0).hypot(v - 50.0)).max(0.0) * PITCH_MM;
        assert_eq!(found(hill), None);
        // A part that covers a side of the picture.
        assert_eq!(found(|u, _| if u < 60.0 { 0.0 } else { -9.0 }), None);
    }
}
