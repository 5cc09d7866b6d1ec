//! What a part lies on: a plane that is seen beside it and lies behind it.
//!
//! The plane is looked for in two ways. First through the points at the picture's border (trimmed least
//! squares: again and again to the nearer half; P. J. Rousseeuw, 1984); it is taken if all four sides
//! of the picture show it. Else, for parts that hide a side, among the flat surfaces that end at
//! the border, each of them all pixels whose heights continue each other without a bend: the
//! largest is taken behind which nothing lies.
//!
//! Either is what the part lies on only if enough lies in front of it, and, if not all sides show it, that stands
//! out by [`FAR_MM`] or more, so that the lower one of two sheets is no floor. A part whose own flat base fills
//! the picture's border looks the same.
//!
//! A pixel beside a step mixes both surfaces, and its height may lie anywhere between them: pixels
//! within [`MARGIN`] of the plane's are left out. That covers the footprint of a pixel and 2 σ of a
//! lens of σ = 0.5 px.
//!
//! What is left in front of the plane is divided by steps. Pieces that are much smaller than the largest, or that
//! reach the picture's border while a large one does not, are other things, such as pins, clamps or the next
//! part.
//!
//! A person may say otherwise ([`Marking`]): which pieces are the part and which are not, and an outline inside which
//! all pieces are.

use super::marking::{Marking, NoPart};
use super::mask::{components, eroded};
use super::region::polygon_spans;
use crate::geometry::Vector;
use crate::math::around;
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
/// Heights of neighbours that differ by more than this are not of one surface, mm; nor are those at so many pixels to
/// either side that together lie so far off the pixel between them, mm, or so many σ of that.
const JUMP_MM: f64 = 1.5;
const BENT_PX: isize = 4;
const BEND_MM: f64 = 0.3;
const BEND_SIGMAS: f64 = 4.0;
/// A flat surface at the border has at least this share of the picture, and of its own pixels at least
/// [`FLAT`] belong to its plane. At most [`BEHIND`] of the picture lies behind what the part lies on.
const LEAST_FLAT: f64 = 0.005;
const FLAT: f64 = 0.9;
const BEHIND: f64 = 0.005;
/// From a plane that not all sides show, half of what lies in front stands out by this much, mm.
const FAR_MM: f64 = 5.0;
/// Without a plane everything stands out by more than any surface does, mm.
const APART_MM: f64 = 1e4;
/// A part has at least this share of the picture.
const LEAST_PART: f64 = 0.02;
/// A step is over at this distance from the plane's last pixel, pixels: the height there is at least a share of
/// [`STEP`] of that at twice the distance.
const NEAR: isize = 3;
const STEP: f64 = 0.7;
/// A part that begins with a step does so at this share of its edge and at so many places; its step is
/// the height that this share of them have less than.
const STEPPED: f64 = 0.5;
const LEAST_STEPS: usize = 40;
const LOW: f64 = 0.1;
/// Pixels beside the plane's that are left out.
const MARGIN: usize = 2;
/// Smaller pieces are noise, pixels.
const CRUMB: usize = 20;
/// Pieces smaller than this share of the largest one are other things.
const PIECE: f64 = 0.1;

/// A touch means the piece that is nearest to it within so many pixels.
const TOUCH: isize = 8;

/// What surrounds a part.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// The pixels of the part, row by row.
    pub part: Vec<bool>,
    /// The part stands out from what it lies on by this much, mm: its lowest steps, or half of it where it
    /// rises out of that. `None` where no plane is seen behind it.
    pub step_mm: Option<f64>,
    /// The pixels of other things in front of what the part lies on.
    pub others: Vec<bool>,
    /// The plane that it lies on: z at x = y = 0, mm, and what z rises by along x and y, mm per mm.
    pub ground: Option<[f64; 3]>,
}

impl Surroundings {
    /// Without the part's pixels beside other things, which hide others of them where the part is moved by up to
    /// `away` pixels.
    #[must_use]
    pub fn clear_of_others(mut self, width: usize, away: usize) -> Self {
        let rows = self.part.len() / width.max(1);
        let reach = away + MARGIN;
        for at in (0..self.others.len()).filter(|at| self.others[*at]) {
            for row in around(at / width, reach, rows) {
                let columns = around(at % width, reach, width);
                self.part[row * width + columns.start..row * width + columns.end].fill(false);
            }
        }
        self
    }
}

/// Finds what surrounds a part in a picture of `pixels` pixels with `width` columns. `point` gives the
/// point in mm that a pixel sees, `None` where it has no height; `sigma_mm` is the σ of a height. `empty` has the
/// heights of the same pixels without a part, mm, where that was recorded: what has the same height is not of the
/// part. `None` if no plane is seen beside something that lies in front of it, and neither was marked or recorded.
///
/// # Errors
/// If nothing stands out where a person has touched the part, or at all.
pub fn surroundings(
    (pixels, width): (usize, usize),
    sigma_mm: f64,
    (marking, empty): (&Marking, Option<&[f32]>),
    point: impl Fn(usize) -> Option<Vector>,
) -> Result<Option<Surroundings>, NoPart> {
    let size = [width, pixels / width.max(1)];
    let reach = SIGMAS * sigma_mm + ROUGH_MM;
    let all_round = all_round(&point, size, reach);
    let plane = all_round.or_else(|| flat(&point, size, sigma_mm, reach));
    let is_told = !marking.is_empty() || empty.is_some();
    if plane.is_none() && !is_told {
        return Ok(None);
    }
    // Without a plane nothing is behind.
    let above = |point: Vector| plane.map_or(point.z + APART_MM, |plane| plane.above(point));
    let heights = (0..pixels).map(|at| point(at).map_or(f64::NAN, above) as f32);
    let heights: Vec<f32> = heights.collect();
    let before = |at: usize| empty?.get(at).copied().filter(|z| z.is_finite());
    let above = |at: usize| match before(at).zip(point(at)) {
        Some((before, point)) => point.z as f32 - before,
        None => heights[at],
    };
    let front = Front {
        above: (0..pixels).map(above).collect(),
        heights: &heights,
        size,
        reach: if empty.is_some() {
            reach * core::f64::consts::SQRT_2
        } else {
            reach
        },
    };
    let [part, others] = front.part(marking)?;
    let heights = part.iter().zip(&front.above).filter(|(part, _)| **part);
    let mut heights: Vec<f64> = heights.map(|(_, above)| f64::from(*above)).collect();
    match is_told {
        true if heights.is_empty() => return Err(NoPart::Nothing),
        false if (heights.len() as f64) < LEAST_PART * pixels as f64 => return Ok(None),
        _ => {}
    }
    let middle = quantile(&mut heights, 0.5);
    let stands_out = is_told || all_round.is_some() || middle >= FAR_MM;
    Ok(stands_out.then(|| Surroundings {
        part,
        step_mm: plane.map(|_| front.step().unwrap_or(middle)),
        others,
        ground: plane.map(|plane| plane.0),
    }))
}

/// The value that a share of others are less than.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = (share * values.len() as f64) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// A picture of what lies in front of a plane, or of the empty station where that is known.
struct Front<'a> {
    /// How far each pixel's point lies in front of it, mm; not a number where there is no height.
    above: Vec<f32>,
    /// How far it lies in front of the plane, whatever is known of the empty station: a step between two of these
    /// divides pieces.
    heights: &'a [f32],
    size: [usize; 2],
    /// What is less far in front is not of the part, mm.
    reach: f64,
}

impl Front<'_> {
    /// Whether a pixel is not the plane's own.
    fn is_apart(&self, at: usize) -> bool {
        !(f64::from(self.above[at]) <= self.reach)
    }

    /// The pixels of the part, and those of other things.
    fn part(&self, marking: &Marking) -> Result<[Vec<bool>; 2], NoPart> {
        let (width, pixels) = (self.size[0], self.above.len());
        let apart: Vec<bool> = (0..pixels).map(|at| self.is_apart(at)).collect();
        let apart = eroded(&apart, width, MARGIN);
        let is_front = |at: usize| apart[at] && !self.above[at].is_nan();
        let jumps = |at: usize| {
            let beside = beside(at, self.size).filter(|next| is_front(*next));
            let mut off = beside.map(|next| (self.heights[next] - self.heights[at]).abs());
            off.any(|off| f64::from(off) > JUMP_MM)
        };
        let smooth: Vec<bool> = (0..pixels).map(|at| is_front(at) && !jumps(at)).collect();
        let mut pieces = components(&smooth, width, false);
        pieces.retain(|piece| piece.len() >= CRUMB);
        let is_cut = |piece: &Vec<usize>| piece.iter().any(|at| is_border(*at, self.size));
        let sizes = |whole: bool| {
            let wanted = pieces.iter().filter(move |piece| !whole || !is_cut(piece));
            wanted.map(Vec::len).max().unwrap_or(0) as f64
        };
        let (whole, largest) = (sizes(true), sizes(false));
        let is_inside = whole >= PIECE * largest;
        let least = PIECE * if is_inside { whole } else { largest };
        let touched = |places: &[[u16; 2]]| -> Vec<Option<usize>> {
            let piece = |at: &[u16; 2]| self.touched(*at, &pieces);
            places.iter().map(piece).collect()
        };
        let [own, not] = [touched(&marking.part), touched(&marking.others)];
        if let Some(missed) = own.iter().position(Option::is_none) {
            return Err(NoPart::Touched(marking.part[missed]));
        }
        let corners = marking.outline.iter();
        let corners: Vec<(f64, f64)> = corners.map(|[u, v]| ((*u).into(), (*v).into())).collect();
        let mut inside = vec![corners.is_empty(); pixels];
        for (row, columns) in polygon_spans(&corners, width, self.size[1]) {
            inside[row * width + columns.start..row * width + columns.end].fill(true);
        }
        let [mut part, mut others] = [vec![false; pixels], vec![false; pixels]];
        for (number, piece) in pieces.iter().enumerate() {
            let is_own = own.contains(&Some(number));
            let is_small = corners.is_empty() && (piece.len() as f64) < least;
            let is_beside = corners.is_empty() && is_inside && is_cut(piece);
            let is_other = !is_own && (not.contains(&Some(number)) || is_small || is_beside);
            for &at in piece {
                let is_part = is_own || !is_other && inside[at];
                let kind = if is_part { &mut part } else { &mut others };
                kind[at] = true;
            }
        }
        // A step of the part's own.
        let own = |at: usize| {
            let is_beside = |kind: &[bool]| beside(at, self.size).any(|next| kind[next]);
            is_front(at) && !smooth[at] && is_beside(&part) && !is_beside(&others)
        };
        let own: Vec<usize> = (0..pixels).filter(|at| own(*at)).collect();
        own.into_iter().for_each(|at| part[at] = true);
        Ok([part, others])
    }

    /// The piece that is meant by a touch.
    fn touched(&self, at: [u16; 2], pieces: &[Vec<usize>]) -> Option<usize> {
        let [u, v] = at.map(|at| at as isize);
        let off = |place: usize| {
            let (column, row) = (place % self.size[0], place / self.size[0]);
            (column as isize - u).abs().max((row as isize - v).abs())
        };
        let nearest = |(number, piece): (usize, &Vec<usize>)| {
            let off = piece.iter().map(|at| off(*at)).min()?;
            (off <= TOUCH).then_some((off, number))
        };
        let nearest = pieces.iter().enumerate().filter_map(nearest).min();
        nearest.map(|(_, number)| number)
    }

    /// How far the lowest steps stand out from the plane; `None` if what lies in front of it rises out of it.
    fn step(&self) -> Option<f64> {
        let (mut edges, mut steps) = (0, Vec::new());
        for at in (0..self.above.len()).filter(|at| !self.is_apart(*at)) {
            for way in BESIDE {
                let beyond = |by: isize| beyond(at, way.map(|way| way * by), self.size);
                let places = [1, NEAR, 2 * NEAR].map(beyond);
                let [Some(next), Some(near), Some(far)] = places else {
                    continue;
                };
                let [near, far] = [near, far].map(|at| f64::from(self.above[at]));
                if self.is_apart(next) && far > self.reach && !near.is_nan() {
                    edges += 1;
                    steps.extend((near >= STEP * far).then_some(near));
                }
            }
        }
        let is_stepped = steps.len() >= LEAST_STEPS && steps.len() as f64 >= STEPPED * edges as f64;
        is_stepped.then(|| quantile(&mut steps, LOW))
    }
}

/// z = a + b x + c y.
#[derive(Clone, Copy)]
struct Plane([f64; 3]);

impl Plane {
    fn above(self, point: Vector) -> f64 {
        let Self([a, b, c]) = self;
        point.z - (a + b * point.x + c * point.y)
    }

    fn through(points: impl Iterator<Item = Vector>) -> Option<Self> {
        let rows = points.map(|point| ([1.0, point.x, point.y], point.z));
        Normal::of(rows).solve().map(Self)
    }

    /// Through the nearer half of these points, found again and again.
    fn trimmed(known: &[Vector]) -> Option<Self> {
        let mut plane = Self::through(known.iter().copied())?;
        for _ in 0..ROUNDS {
            let off = |point: &Vector| plane.above(*point).abs();
            let limit = quantile(&mut known.iter().map(off).collect::<Vec<_>>(), KEPT);
            let near = known.iter().copied().filter(|point| off(point) <= limit);
            plane = Self::through(near)?;
        }
        Some(plane)
    }
}

/// The plane that all four sides of a picture show.
fn all_round(
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
    let known: Vec<Vector> = sides.iter().flatten().flatten().copied().collect();
    let plane = Plane::trimmed(&known)?;
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

/// The largest flat surface at the border of a picture behind which nothing lies.
fn flat(
    point: &impl Fn(usize) -> Option<Vector>,
    [width, rows]: [usize; 2],
    sigma_mm: f64,
    reach: f64,
) -> Option<Plane> {
    let pixels = width * rows;
    // Of two heights less twice a third.
    let noise = sigma_mm * libm::sqrt(6.0);
    let most = BEND_MM.max(BEND_SIGMAS * noise);
    let height = |at| point(at).map_or(f64::NAN, |point: Vector| point.z);
    let heights: Vec<f64> = (0..pixels).map(height).collect();
    let size = [width, rows];
    let along = |at: usize, way: [isize; 2]| {
        let height = beyond(at, way, size).map_or(f64::NAN, |beyond| heights[beyond]);
        height - heights[at]
    };
    let continues = |at: usize| {
        [[1, 0], [0, 1]].into_iter().all(|way: [isize; 2]| {
            let far = |by: isize| along(at, way.map(|way| way * by));
            let bend = far(BENT_PX) + far(-BENT_PX);
            // Not a number where a height is missing.
            !(far(1).abs() > JUMP_MM || bend.abs() > most)
        })
    };
    let continues = |at: usize| heights[at].is_finite() && continues(at);
    let continues: Vec<bool> = (0..pixels).map(continues).collect();
    let mut pieces = components(&continues, width, false);
    pieces.retain(|piece| {
        let is_large = piece.len() as f64 >= LEAST_FLAT * pixels as f64;
        is_large && piece.iter().any(|at| is_border(*at, size))
    });
    pieces.sort_by_key(|piece| core::cmp::Reverse(piece.len()));
    pieces.into_iter().find_map(|piece| {
        let own: Vec<Vector> = piece.into_iter().filter_map(point).collect();
        let plane = Plane::trimmed(&own)?;
        let on_plane = own.iter().filter(|own| plane.above(**own).abs() <= reach);
        let all = (0..pixels).filter_map(point);
        let behind = all.clone().filter(|point| plane.above(*point) < -FAR_MM);
        let is_flat = on_plane.count() as f64 >= FLAT * own.len() as f64;
        if !is_flat || behind.count() as f64 > BEHIND * pixels as f64 {
            return None;
        }
        // Pieces that the part keeps apart are of one plane.
        Plane::through(all.filter(|point| plane.above(*point).abs() <= reach))
    })
}

/// The ways to the pixels that share an edge with a pixel.
const BESIDE: [[isize; 2]; 4] = [[1, 0], [-1, 0], [0, 1], [0, -1]];

/// The pixel so many columns and rows away from another one; `None` outside of the picture.
fn beyond(at: usize, [right, down]: [isize; 2], [width, rows]: [usize; 2]) -> Option<usize> {
    let u = (at % width).checked_add_signed(right);
    let v = (at / width).checked_add_signed(down);
    Some(v.filter(|v| *v < rows)? * width + u.filter(|u| *u < width)?)
}

/// The pixels that share an edge with a pixel.
fn beside(at: usize, size: [usize; 2]) -> impl Iterator<Item = usize> {
    BESIDE
        .into_iter()
        .filter_map(move |way| beyond(at, way, size))
}

fn is_border(at: usize, [width, rows]: [usize; 2]) -> bool {
    let (u, v) = (at % width, at / width);
    u <= MARGIN || v <= MARGIN || u + MARGIN + 1 >= width || v + MARGIN + 1 >= rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    const WIDTH: usize = 120;
    const ROWS: usize = 100;
    const PITCH_MM: f64 = 0.4;

    /// What is found in a picture of these heights, mm, which are not finite where nothing is seen.
    fn found(height: impl Fn(f64, f64) -> f64) -> Option<Surroundings> {
        marked(&Marking::default(), height).unwrap()
    }

    fn marked(
        marking: &Marking,
        height: impl Fn(f64, f64) -> f64,
    ) -> Result<Option<Surroundings>, NoPart> {
        surroundings((WIDTH * ROWS, WIDTH), 0.02, (marking, None), |at| {
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
            assert!(found.step_mm.unwrap() > 0.9 * depth, "{depth}: {found:?}");
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
        assert!(!alone.others.contains(&true));
        let others = among.others.iter().filter(|other| **other).count();
        assert!((450..800).contains(&others), "{others}");
    }

    #[test]
    fn a_pin_that_touches_the_part_is_another_thing_and_the_part_keeps_clear_of_it() {
        let found = found(|u, v| match (u - 92.0).hypot(v - 50.0) < 5.0 {
            true => 12.0,
            false => plate(10.0, u, v),
        });
        let found = found.unwrap();
        assert!(found.others[50 * WIDTH + 92] && !found.part[50 * WIDTH + 92]);
        assert!(found.part[50 * WIDTH + 82]);
        let clear = found.clear_of_others(WIDTH, 4);
        assert!(!clear.part[50 * WIDTH + 83] && clear.part[50 * WIDTH + 78]);
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
    fn where_no_plane_lies_behind_something_everything_is_the_part() {
        let hole = |u: f64, v: f64| (u - 60.0).hypot(v - 50.0) < 20.0;
        assert_eq!(found(|_, _| f64::NAN), None);
        assert_eq!(found(|_, _| 0.0), None);
        // A block with a hole through it, or into it.
        assert_eq!(found(|u, v| if hole(u, v) { f64::NAN } else { 0.0 }), None);
        assert_eq!(found(|u, v| if hole(u, v) { -9.0 } else { 0.0 }), None);
        // A plate in black.
        assert_eq!(found(|u, v| if hole(u, v) { 0.0 } else { f64::NAN }), None);
        // Two sheets.
        assert_eq!(found(|u, _| if u < 60.0 { 0.0 } else { -2.0 }), None);
    }

    #[test]
    fn a_hill_that_rises_out_of_the_floor_is_the_part() {
        let hill = |u: f64, v: f64| (40.0 - (u - 60.0).hypot(v - 50.0)).max(0.0) * PITCH_MM;
        let found = found(hill).unwrap();
        assert!((3.0..8.0).contains(&found.step_mm.unwrap()), "{found:?}");
        for (at, part) in found.part.iter().enumerate() {
            let (u, v) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
            // The plane's own pixels reach 0.25 mm into the hill, and the margin is square.
            let inside = hill(u, v) / PITCH_MM;
            assert!(*part || inside < 4.5, "({u}, {v})");
            assert!(!*part || inside > 2.0, "({u}, {v})");
        }
    }

    #[test]
    fn a_dome_that_hides_sides_and_rises_out_of_the_floor_is_the_part() {
        let dome = |u: f64, v: f64| {
            let off = (u - 80.0).hypot(v - 50.0) * PITCH_MM;
            ((40.0_f64.powi(2) - off * off).max(0.0).sqrt() - 32.0).max(0.0)
        };
        let part = found(dome).unwrap().part;
        assert!(part[50 * WIDTH + 80] && part[50 * WIDTH + 26] && !part[50 * WIDTH + 15]);
    }

    #[test]
    fn a_part_that_hides_sides_of_the_picture_is_told_from_the_floor() {
        // A ridge across the picture over a tilted floor, a ring of which corners and the inside show the floor.
        let ridge = |u: f64, v: f64| {
            let floor = -9.0 - 0.02 * v * PITCH_MM;
            if u < 30.0 {
                floor
            } else {
                5.0 * (u * 0.2).sin()
            }
        };
        let ring = |u: f64, v: f64| {
            let radius = (u - 60.0).hypot(v - 50.0);
            if within(radius, [20.0, 62.0]) {
                radius * PITCH_MM
            } else {
                -30.0
            }
        };
        let ridge = found(ridge).unwrap();
        let of_row = |u: usize| ridge.part[50 * WIDTH + u];
        assert!(!of_row(29) && !of_row(31) && of_row(33) && of_row(110));
        let ring = found(ring).unwrap();
        let of_row = |u: usize| ring.part[50 * WIDTH + u];
        assert!(of_row(20) && !of_row(45) && !of_row(60) && of_row(100));
        assert!(!ring.part[WIDTH + 1]);
    }

    /// A plate, a pin beside it, and the next part at the border.
    fn among(u: f64, v: f64) -> f64 {
        let pin = (u - 18.0).hypot(v - 30.0) < 8.0;
        if pin || (u > 100.0 && within(v, [30.0, 70.0])) {
            2.0
        } else {
            plate(10.0, u, v)
        }
    }

    #[test]
    fn a_touch_makes_a_piece_the_part_or_another_thing_and_one_beside_everything_is_refused() {
        let [on_plate, on_pin, on_next] = [30 * WIDTH + 60, 30 * WIDTH + 20, 50 * WIDTH + 108];
        let pin = Marking {
            part: vec![[22, 36]],
            ..Marking::default()
        };
        let found = marked(&pin, among).unwrap().unwrap();
        assert!(found.part[on_pin] && found.part[on_plate] && found.others[on_next]);
        let next = Marking {
            part: vec![[108, 50]],
            others: vec![[60, 30]],
            ..Marking::default()
        };
        let found = marked(&next, among).unwrap().unwrap();
        assert!(found.part[on_next] && found.others[on_plate] && found.others[on_pin]);
        let missed = Marking {
            part: vec![[5, 90]],
            ..Marking::default()
        };
        assert_eq!(marked(&missed, among), Err(NoPart::Touched([5, 90])));
    }

    #[test]
    fn what_stands_out_inside_an_outline_is_the_part_also_where_no_plane_is_seen() {
        let marking = Marking {
            outline: vec![[5, 5], [70, 5], [70, 95], [5, 95]],
            ..Marking::default()
        };
        let found = marked(&marking, among).unwrap().unwrap();
        let is_part = |u: usize, v: usize| found.part[v * WIDTH + u];
        assert!(is_part(20, 30) && is_part(40, 30) && !is_part(60, 50) && !is_part(80, 30));
        assert!(found.others[30 * WIDTH + 80] && found.ground.is_some());
        let bent = |u: f64, v: f64| 0.01 * (u - 60.0) * (v - 50.0);
        let found = marked(&marking, bent).unwrap().unwrap();
        assert_eq!((found.ground, found.step_mm), (None, None));
        assert!(found.part[50 * WIDTH + 60] && !found.part[50 * WIDTH + 72]);
    }

    #[test]
    fn a_noisy_floor_that_a_part_keeps_from_a_side_is_one_surface() {
        let mut random = SplitMix64::seed_from_u64(4);
        let noise: Vec<f64> = (0..WIDTH * ROWS)
            .map(|_| {
                let twelve = (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64);
                0.15 * (twelve.sum::<f64>() - 6.0)
            })
            .collect();
        let nothing = (&Marking::default(), None);
        let found = surroundings((WIDTH * ROWS, WIDTH), 0.15, nothing, |at| {
            let (u, v) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
            let z = if u > 80.0 {
                0.0
            } else {
                plate(20.0, u + 30.0, v)
            };
            Some(Vector::new(u * PITCH_MM, v * PITCH_MM, z + noise[at]))
        });
        let ground = found.unwrap().unwrap().ground.unwrap();
        assert!((ground[0] + 20.24).abs() < 0.05, "{ground:?}");
    }

    #[test]
    fn what_the_empty_station_shows_is_not_the_part_though_it_is_larger_and_touches_it() {
        // A block as high as the plate, beside it.
        let is_block = |u: f64, v: f64| within(u, [91.0, 118.0]) && within(v, [5.0, 95.0]);
        let station = |u: f64, v: f64| if is_block(u, v) { 0.1 } else { -10.0 };
        let height = |u: f64, v: f64| {
            let is_plate = within(u, [30.0, 90.0]) && within(v, [25.0, 75.0]);
            if is_plate { 0.0 } else { station(u, v) }
        };
        let at = |at: usize| ((at % WIDTH) as f64, (at / WIDTH) as f64);
        let empty: Vec<f32> = (0..WIDTH * ROWS)
            .map(|of| station(at(of).0, at(of).1) as f32)
            .collect();
        let found = |empty: Option<&[f32]>| {
            let told = (&Marking::default(), empty);
            let found = surroundings((WIDTH * ROWS, WIDTH), 0.02, told, |of| {
                let (u, v) = at(of);
                Some(Vector::new(u * PITCH_MM, v * PITCH_MM, height(u, v)))
            });
            found.unwrap().unwrap()
        };
        let places = [50 * WIDTH + 60, 50 * WIDTH + 105];
        let [alone, among] =
            [found(Some(&empty)), found(None)].map(|found| places.map(|at| found.part[at]));
        assert_eq!((alone, among), ([true, false], [true, true]));
        let nothing = vec![f32::NAN; WIDTH * ROWS];
        assert_eq!(found(Some(&nothing)).part, found(None).part);
        let told = (&Marking::default(), Some(&empty[..]));
        let alone = surroundings((WIDTH * ROWS, WIDTH), 0.02, told, |of| {
            let (u, v) = at(of);
            Some(Vector::new(u * PITCH_MM, v * PITCH_MM, station(u, v)))
        });
        assert_eq!(alone, Err(NoPart::Nothing));
    }
}
