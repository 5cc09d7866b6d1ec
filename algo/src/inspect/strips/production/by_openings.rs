//! Parts whose shape leaves their motion open are placed by the circles and slots that gauges are of.
//!
//! # Idea
//! Heights determine the planes of contours, also of a flat plate. Where the centres of contours are
//! found in them, they lie as on golden but for the motion along the open directions. A displaced
//! hole must not pull the part: the centres agree as those of one rigid part, or the motion stays
//! not determined.
//!
//! # Equations
//! With r the way from where a centre is expected to where it is found, along the two axes of its
//! plane, and J the way that a motion by 1 mm along each open direction takes it there,
//!
//! ```text
//! J δ = r        C = s² (Σ Jᵀ J / σ²)⁻¹        s² = max(1, χ² per degree of freedom)
//! ```
//!
//! σ² is the variance of the centre by noise and by what is uncertain of its contour anew wherever it lies; the rest
//! ([`ContourSource`](crate::inspect::contour::ContourSource)) is golden's, too, and no part of r.
//!
//! # Accuracy
//! `a_flat_plate_is_placed_by_its_holes_in_all_surroundings`: 1.6 µm and 0.0016° over black and grey, 2.1 µm over white.

use super::anchors::{LEAST, MOST};
use super::plan::Production;
use super::strip::Strips;
use crate::geometry::Vector;
use crate::inspect::align::{Fitting, Matrix6, Placed};
use crate::inspect::feature::PlaneFrame;
use crate::inspect::strips::readings::{ContourFit, ExpectedContour, REACH_MM, Signal, moved};
use crate::math::solve::solve_symmetric;
use crate::pipeline::for_each;
use alloc::vec::Vec;

/// Centres agree that lie within this distance of where all together say, mm: holes of good parts scatter.
const AGREE_MM: f64 = 0.1;
/// After a farther way contours are looked for again, mm.
const NEAR_MM: f64 = 0.1;
/// A larger error along an open direction determines nothing, mm (1 σ).
const LARGEST_SIGMA_MM: f64 = 0.05;

/// Shares of the open directions, or one row of a matrix of them.
type Shares = [f64; 6];

/// What one centre says of the motion.
#[derive(Clone, Copy, Debug)]
struct Centre {
    /// Along each axis of its plane: J, r and σ².
    axes: [(Shares, f64, f64); 2],
}

/// The motion along the open directions.
#[derive(Clone, Copy, Debug)]
struct OpenMotion {
    shares: Shares,
    covariance: Matrix6,
}

/// How a part lies that was placed by its heights, whose points the strips still have, if contours determine
/// what they leave open; `None` if they do not.
pub fn place_by_openings(
    production: &Production,
    placed: &Placed,
    light: Signal<'_>,
    strips: &mut Strips,
) -> Option<Placed> {
    let (contours, alignment) = (
        production.readings.contours.as_ref()?,
        production.alignment.as_ref()?,
    );
    let is_open = !placed.free.is_empty() && !production.anchors.is_empty();
    if !is_open || !matches!(light, Signal::Frames(..)) {
        return None;
    }
    let fitting = alignment.fitting(production.golden.surface());
    let mut placed = placed.clone();
    // A part lies anywhere within the tolerance first, and then nearly where its openings are.
    for reach_mm in [
        production.readings.contour_reach_mm(Some(&placed)),
        REACH_MM,
    ] {
        let work: Vec<_> = strips.anchors.iter_mut().zip(&production.anchors).collect();
        for_each(work, |_, (found, &at)| {
            let expected = &contours.all[at];
            let plane = &production.readings.planes[expected.plane];
            let expected = (contours, expected);
            found.find(
                expected,
                &production.golden,
                plane,
                (Some(&placed), reach_mm),
                light,
            );
        });
        let found = strips.anchors.iter().zip(&production.anchors);
        let centres = found.filter_map(|(found, &at)| {
            let expected = &contours.all[at];
            let frame = contours.frame(expected, &production.readings.planes[expected.plane])?;
            Centre::of(
                expected,
                found,
                &moved(&frame, &placed.motion),
                (&fitting, &placed),
            )
        });
        let centres: heapless::Vec<Centre, MOST> = centres.collect();
        let solution = agreed(&centres, placed.free.len())?;
        let along = |i: usize| -> f64 {
            let ways = placed.free.iter().zip(solution.shares);
            ways.map(|(way, share)| way[i] * share).sum()
        };
        let further: Shares = core::array::from_fn(along);
        let covariance = solution.over(&placed.free);
        let motion = fitting.then(&placed.motion, &further);
        let fitted = fitting.fit(Some(motion), &strips.samples, &mut strips.fitting)?;
        if fitted.free.len() != placed.free.len() {
            return None;
        }
        placed = fitted;
        let is_near = further.iter().map(|way| way * way).sum::<f64>() < NEAR_MM * NEAR_MM;
        if is_near {
            return Some(fitting.determined(&placed, &covariance));
        }
    }
    None
}

impl Centre {
    /// Of a contour that was found where its plane lies as in `frame`; `None` if it was not.
    fn of(
        expected: &ExpectedContour,
        found: &ContourFit,
        frame: &PlaneFrame,
        (fitting, placed): (&Fitting<'_>, &Placed),
    ) -> Option<Self> {
        let rim = found.opening()?;
        let (from, to) = (expected.outline.middle(), rim.outline.middle());
        let at = frame.point(to.0, to.1) - placed.motion.shift;
        let ways: heapless::Vec<Vector, 6> = placed
            .free
            .iter()
            .map(|open| fitting.way(open, at))
            .collect();
        let axis = |axis: Vector, off: f64, i: usize| {
            let mut row = Shares::default();
            for (share, way) in row.iter_mut().zip(&ways) {
                *share = way.dot(axis);
            }
            let inputs = rim.inputs.iter().filter(|of| of.source.is_of_place());
            let inputs = inputs.map(|of| of.off[i] * of.off[i]);
            (row, off, rim.covariance[i][i] + inputs.sum::<f64>())
        };
        Some(Self {
            axes: [
                axis(frame.x, to.0 - from.0, 0),
                axis(frame.y, to.1 - from.1, 1),
            ],
        })
    }

    /// How far it lies from where a motion along the open directions takes it, mm.
    fn off(&self, shares: &Shares) -> f64 {
        let [x, y] = self.axes.map(|(row, off, _)| off - dot(&row, shares));
        libm::hypot(x, y)
    }
}

/// The motion along so many open directions by which centres agree, all of them or, of [`MOST`], all but one.
fn agreed(centres: &[Centre], open: usize) -> Option<OpenMotion> {
    let without = |out: Option<usize>| {
        let kept = || {
            centres
                .iter()
                .enumerate()
                .filter(move |(at, _)| Some(*at) != out)
        };
        let solution = solve(kept().map(|(_, centre)| centre), open)?;
        let agree = kept().all(|(_, centre)| centre.off(&solution.shares) <= AGREE_MM);
        let outside = out.map_or(0.0, |out| centres[out].off(&solution.shares));
        agree.then_some((outside, solution))
    };
    if centres.len() < LEAST {
        return None;
    }
    let all = without(None);
    if all.is_some() || centres.len() < MOST {
        return all.map(|(_, solution)| solution);
    }
    let alone = (0..centres.len()).filter_map(|out| without(Some(out)));
    // The one that the others agree without is farthest off.
    alone
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, solution)| solution)
}

/// Least squares; `None` where the centres determine too little.
fn solve<'a>(centres: impl Iterator<Item = &'a Centre> + Clone, open: usize) -> Option<OpenMotion> {
    let (mut matrix, mut right) = (Matrix6::default(), Shares::default());
    let rows = centres.flat_map(|centre| centre.axes);
    for (row, off, variance) in rows.clone() {
        for i in 0..open {
            right[i] += row[i] * off / variance;
            for j in 0..open {
                matrix[i][j] += row[i] * row[j] / variance;
            }
        }
    }
    let packed = |b: &mut [f64]| {
        let mut a = [0.0; 36];
        for i in 0..open {
            a[i * open..][..open].copy_from_slice(&matrix[i][..open]);
        }
        solve_symmetric(&mut a[..open * open], b)
    };
    packed(&mut right[..open])?;
    let squares = rows.clone().map(|(row, off, variance)| {
        let off = off - dot(&row, &right);
        off * off / variance
    });
    let freedom = rows.count().saturating_sub(open).max(1) as f64;
    let scale = (squares.sum::<f64>() / freedom).max(1.0);
    let mut covariance = Matrix6::default();
    for (i, column) in covariance.iter_mut().enumerate().take(open) {
        column[i] = scale;
        packed(&mut column[..open])?;
    }
    let is_sharp = |i: usize| covariance[i][i] <= LARGEST_SIGMA_MM * LARGEST_SIGMA_MM;
    (0..open).all(is_sharp).then_some(OpenMotion {
        shares: right,
        covariance,
    })
}

impl OpenMotion {
    /// The covariance of a motion along these open directions.
    fn over(&self, free: &[Shares]) -> Matrix6 {
        let mut sum = Matrix6::default();
        for (p, u) in free.iter().enumerate() {
            for (q, v) in free.iter().enumerate() {
                for i in 0..6 {
                    for j in 0..6 {
                        sum[i][j] += self.covariance[p][q] * u[i] * v[j];
                    }
                }
            }
        }
        sum
    }
}

fn dot(a: &Shares, b: &Shares) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGMA: f64 = 0.001;
    /// Where the centres lie, mm.
    const PLACES: [(f64, f64); MOST] = [(-60.0, 40.0), (-60.0, -40.0), (24.0, 2.0), (55.0, 41.0)];

    /// Centres of a plate that is moved along x and y and turned by a way of 1 mm at 50 mm, each off by so much along x.
    fn centres(moved: [f64; 3], off: &[f64]) -> Vec<Centre> {
        let centre = |(&(x, y), off): (&(f64, f64), &f64)| {
            let row =
                |along: [f64; 3]| core::array::from_fn(|i| along.get(i).copied().unwrap_or(0.0));
            let rows = [row([1.0, 0.0, -y / 50.0]), row([0.0, 1.0, x / 50.0])];
            let way = |row: &Shares| row.iter().zip(moved).map(|(a, b)| a * b).sum::<f64>();
            Centre {
                axes: [
                    (rows[0], way(&rows[0]) + off, SIGMA * SIGMA),
                    (rows[1], way(&rows[1]), SIGMA * SIGMA),
                ],
            }
        };
        PLACES.iter().zip(off).map(centre).collect()
    }

    fn error(centres: &[Centre], moved: [f64; 3]) -> Option<f64> {
        let solution = agreed(centres, 3)?;
        let off = solution
            .shares
            .iter()
            .zip(moved)
            .map(|(a, b)| libm::fabs(a - b));
        Some(off.fold(0.0, f64::max))
    }

    #[test]
    fn centres_of_one_rigid_part_say_how_it_was_moved() {
        let moved = [0.31, -0.22, 0.13];
        for count in LEAST..=MOST {
            assert!(error(&centres(moved, &[0.0; MOST][..count]), moved).unwrap() < 1e-9);
        }
        assert_eq!(error(&centres(moved, &[0.0]), moved), None);
    }

    #[test]
    fn one_hole_that_lies_elsewhere_is_left_out_of_four_and_makes_three_disagree() {
        let moved = [0.31, -0.22, 0.13];
        for at in 0..MOST {
            let mut off = [0.0; MOST];
            off[at] = 0.4;
            let centres = centres(moved, &off);
            assert!(error(&centres, moved).unwrap() < 1e-9, "{at}");
            if at < 3 {
                assert_eq!(error(&centres[..3], moved), None, "{at}");
            }
        }
    }

    #[test]
    fn centres_that_scatter_more_than_they_say_widen_the_error() {
        let moved = [0.0; 3];
        let sigma = |off: &[f64]| agreed(&centres(moved, off), 3).unwrap().covariance[0][0];
        let (exact, scattered) = (sigma(&[0.0; MOST]), sigma(&[0.02, -0.02, 0.02, -0.02]));
        assert!(scattered > 20.0 * exact, "{scattered} {exact}");
    }
}
