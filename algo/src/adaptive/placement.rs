//! How far a part's placement can change the phase of each pixel.
//!
//! A single level cannot prove its fringe order: the order is right only where the phase stays
//! within half a turn of the golden map. Two dense levels reach further. The golden surface and the
//! declared tolerance of placement decide which pixels are safe.
//!
//! # Equation
//! A part that is moved by at most T lies inside its own dilation by a ball of radius T (J.
//! Serra, *Image Analysis and Mathematical Morphology*, 1982). Along the ray of pixel p, with ρ_q
//! the distance of golden's point from the camera at pixel q and s the least distance in mm between
//! the rays of neighbouring pixels, that dilation is between
//!
//! ```text
//! near(p) = min_q ρ_q − h(|p − q|)      far(p) = max_q ρ_q + h(|p − q|)      h(d) = √(T² − (s · max(0, d − ½√2))²)
//! ```
//!
//! over all pixels q with a real h. Half a pixel's diagonal covers the surface between the pixels,
//! so nothing is stepped over, however narrow it is. The reach is the larger |Φ − Φ_golden(p)| of
//! the two ends, as Φ is monotonic along a ray.
//!
//! # Cost
//! About 4 (T/s)² maxima per pixel, at most 3 times the square of [`MAX_CELLS`]: where T is more
//! than [`MAX_CELLS`] pixels, ρ is dilated by a square first and q goes over every second pixel,
//! every third and so on, with the square's half diagonal in place of the pixel's.

use crate::geometry::{Triangulator, Vector};
use crate::pipeline::{KnownSurface, for_each_row, for_each_row_of_two, over_squares};
use alloc::vec;
use alloc::vec::Vec;

/// Most steps of q from a pixel in each direction.
const MAX_CELLS: usize = 24;
/// The distance between neighbouring rays is evaluated every so many pixels in each direction.
const SPACING: usize = 8;

/// The largest |ΔΦ| in turns of each pixel when the part is moved by up to `tolerance` mm
/// in any direction; infinite where golden is unknown within reach of the move.
///
/// Occlusion is neglected, which can only make the result larger. Tests:
/// `a_narrow_rib_is_not_stepped_over`, `the_reach_is_that_of_moves_in_all_directions`.
pub fn phase_reach(triangulator: &Triangulator, golden: &KnownSurface, tolerance: f64) -> Vec<f32> {
    let width = golden.width.max(1);
    let eye = triangulator.camera().centre();
    let known = |at: usize| golden.phase[at].is_known() && golden.height[at].is_known();
    let seen = |at: usize| triangulator.point(at % width, at / width, golden.height[at]);
    let mut distances = vec![f32::NAN; golden.height.len()];
    for_each_row(&mut distances, width, |v, row| {
        for (u, distance) in row.iter_mut().enumerate() {
            let at = v * width + u;
            if let Some(point) = seen(at).filter(|_| known(at)) {
                *distance = (point - eye).length() as f32;
            }
        }
    });
    let mut reach = vec![f32::INFINITY; golden.height.len()];
    let Some(spacing) = spacing(triangulator, golden) else {
        return reach;
    };
    let ball = Ball::new(tolerance, spacing);
    let (near, far) = ball.dilated(&distances, width);
    for_each_row(&mut reach, width, |v, row| {
        for (u, reach) in row.iter_mut().enumerate() {
            let at = v * width + u;
            let Some(point) = seen(at).filter(|_| known(at)) else {
                continue;
            };
            let ray = point - eye;
            let length = ray.length();
            let change = |distance: f32| {
                let end = eye + ray * (f64::from(distance) / length);
                let (xi, eta) = triangulator.projector_point(end)?;
                let phase = triangulator.function().at(xi, eta);
                Some(libm::fabs(phase - golden.phase[at].turns()) as f32)
            };
            // Where the projector cannot light one of the two ends, the change is not known.
            let ends = change(near[at]).zip(change(far[at]));
            *reach = ends.map_or(f32::INFINITY, |(near, far)| near.max(far));
        }
    });
    // Something unknown may move into view.
    let known: Vec<bool> = golden.phase.iter().map(|phase| phase.is_known()).collect();
    let away = libm::ceil(tolerance / spacing) as usize + 1;
    let known = over_squares(&known, width, away, |a, b| a && b);
    for (reach, _) in reach.iter_mut().zip(known).filter(|(_, known)| !known) {
        *reach = f32::INFINITY;
    }
    reach
}

/// The least distance at golden's points between the rays of neighbouring pixels, mm.
fn spacing(triangulator: &Triangulator, golden: &KnownSurface) -> Option<f64> {
    let (width, rows) = (golden.width, golden.height.len() / golden.width.max(1));
    let camera = triangulator.camera();
    let of_pixel = |u: usize, v: usize| {
        let point = triangulator.point(u, v, golden.height[v * width + u])?;
        let ray = |u: f64, v: f64| camera.ray(u, v).map(|ray| ray * (1.0 / ray.length()));
        let from = point - camera.centre();
        let apart = |beside: Vector| from.cross(beside).length();
        let (u, v) = (u as f64, v as f64);
        Some(apart(ray(u + 1.0, v)?).min(apart(ray(u, v + 1.0)?)))
    };
    let pixels = (0..rows).step_by(SPACING);
    let pixels = pixels.flat_map(|v| (0..width).step_by(SPACING).map(move |u| (u, v)));
    let spacings = pixels.filter_map(|(u, v)| of_pixel(u, v));
    // Between the sampled pixels it is hardly less.
    let least = spacings.reduce(f64::min);
    least.map(|least| 0.99 * least).filter(|least| *least > 0.0)
}

/// The ball that the surface is dilated by, as seen by the camera.
struct Ball {
    /// Pixels between one q and the next.
    stride: usize,
    /// h of each (row, column) from the middle, in strides.
    rises: Vec<(isize, isize, f32)>,
}

impl Ball {
    fn new(tolerance: f64, spacing: f64) -> Self {
        let radius = tolerance / spacing;
        let stride = (libm::ceil(radius) as usize).div_ceil(MAX_CELLS).max(1);
        // Half the diagonal of the square of pixels that a q stands for.
        let half = stride as f64 * core::f64::consts::FRAC_1_SQRT_2;
        let cells = libm::floor((radius + half) / stride as f64) as isize;
        let all = (-cells..=cells).flat_map(|dv| (-cells..=cells).map(move |du| (dv, du)));
        let rise = |(dv, du): (isize, isize)| {
            let away = libm::hypot(dv as f64, du as f64) * stride as f64;
            let aside = spacing * (away - half).max(0.0);
            let square = tolerance * tolerance - aside * aside;
            (square >= 0.0).then(|| (dv, du, libm::sqrt(square) as f32))
        };
        Self {
            stride,
            rises: all.filter_map(rise).collect(),
        }
    }

    /// The nearest and the farthest distance of the dilated surface at each pixel; NaN among
    /// `distances` is unknown.
    fn dilated(&self, distances: &[f32], width: usize) -> (Vec<f32>, Vec<f32>) {
        let rows = distances.len() / width;
        let half = self.stride / 2;
        let spread = |sign: f32| {
            let values = distances.iter().map(|distance| match distance.is_nan() {
                true => f32::NEG_INFINITY,
                false => sign * distance,
            });
            over_squares(&values.collect::<Vec<_>>(), width, half, f32::max)
        };
        // The nearest distances are the largest of the negative ones.
        let (nearest, farthest) = (spread(-1.0), spread(1.0));
        let mut near = vec![f32::NEG_INFINITY; distances.len()];
        let mut far = vec![f32::NEG_INFINITY; distances.len()];
        for_each_row_of_two((&mut near, width), (&mut far, width), |v, near, far| {
            for &(dv, du, rise) in &self.rises {
                let Some(row) = v.checked_add_signed(dv * self.stride as isize) else {
                    continue;
                };
                if row < rows {
                    let line = row * width..(row + 1) * width;
                    raise(
                        near,
                        &nearest[line.clone()],
                        du * self.stride as isize,
                        rise,
                    );
                    raise(far, &farthest[line], du * self.stride as isize, rise);
                }
            }
            near.iter_mut().for_each(|near| *near = -*near);
        });
        (near, far)
    }
}

/// `out[u] = max(out[u], line[u + aside] + rise)`.
fn raise(out: &mut [f32], line: &[f32], aside: isize, rise: f32) {
    let shift = aside.unsigned_abs().min(line.len());
    let (out, line) = match aside < 0 {
        true => (&mut out[shift..], line),
        false => (&mut *out, &line[shift..]),
    };
    for (out, value) in out.iter_mut().zip(line) {
        let value = value + rise;
        *out = if value > *out { value } else { *out };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Pinhole, PinholeModel, Reference};
    use crate::pattern::PhaseFunction;
    use crate::units::{AbsolutePhase, Height};
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    /// Of the plane z = 0, as of a head of 1456 × 1088 pixels with a field of 233 mm.
    const MM_PER_PIXEL: f64 = 0.16;
    const RIB: Rib = Rib {
        half: 0.5,
        high: 10.0,
    };

    fn device(angle: f64, size: (usize, usize), mm_per_pixel: f64) -> Pinhole {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let model = PinholeModel {
            fx: 600.0 / mm_per_pixel,
            fy: 600.0 / mm_per_pixel,
            cx: (size.0 - 1) as f64 / 2.0,
            cy: (size.1 - 1) as f64 / 2.0,
            distortion: [-0.12, 0.15, 2e-4, -3e-4, 0.0],
            rotation: [cos, 0.0, -sin, 0.0, -1.0, 0.0, -sin, 0.0, -cos],
            translation: [0.0, 0.0, 600.0],
        };
        Pinhole::new(model, size.0, size.1).unwrap()
    }

    fn rig(size: (usize, usize)) -> Triangulator {
        // 16 pixels per fringe: 3 mm of height are a fifth of a turn.
        let function = PhaseFunction::vertical(1024, 768, 1024.0 / 16.0).unwrap();
        // From straight above, so that the rib's walls do not make it wider.
        let camera = device(0.0, size, MM_PER_PIXEL);
        let projector = device(-0.47, (1024, 768), 0.47);
        Triangulator::new(camera, projector, Reference::Models, function, None).unwrap()
    }

    /// A rib along y on a plane, with upright walls.
    #[derive(Clone, Copy)]
    struct Rib {
        half: f64,
        high: f64,
    }

    impl Rib {
        /// z where a pixel's ray meets it after a move.
        fn seen(&self, rig: &Triangulator, (u, v): (usize, usize), by: Vector) -> f64 {
            let at = |z: f64| rig.point(u, v, Height::from_mm(z)).unwrap();
            let (foot, top) = (at(by.z), at(by.z + self.high));
            let beside = |point: Vector| point.x - by.x;
            if beside(top).abs() <= self.half {
                return top.z;
            }
            // The camera looks from +x: a ray may meet the wall there.
            let (above, below) = (beside(top), beside(foot));
            match above > self.half && below < self.half {
                true => by.z + self.high * (self.half - below) / (above - below),
                false => by.z,
            }
        }
    }

    fn golden(
        rig: &Triangulator,
        size: (usize, usize),
        seen: impl Fn(usize, usize) -> f64,
    ) -> KnownSurface {
        let heights = (0..size.0 * size.1).map(|at| seen(at % size.0, at / size.0));
        let heights: Vec<f64> = heights.collect();
        let phase = |(at, &z): (usize, &f64)| {
            AbsolutePhase::from_turns(phase(rig, (at % size.0, at / size.0), z))
        };
        KnownSurface {
            width: size.0,
            phase: heights.iter().enumerate().map(phase).collect(),
            height: heights.iter().map(|&z| Height::from_mm(z)).collect(),
        }
    }

    fn phase(rig: &Triangulator, (u, v): (usize, usize), z: f64) -> f64 {
        let point = rig.point(u, v, Height::from_mm(z)).unwrap();
        let (xi, eta) = rig.projector_point(point).unwrap();
        rig.function().at(xi, eta)
    }

    /// Moves by up to `tolerance`.
    fn moves(count: usize, tolerance: f64) -> Vec<Vector> {
        let mut random = SplitMix64::seed_from_u64(3);
        let mut between = || (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        let mut found = Vec::new();
        while found.len() < count {
            let by = Vector::new(between(), between(), between());
            if by.length() <= 1.0 {
                found.push(by * tolerance);
            }
        }
        found
    }

    /// Slips of a single level on a rib, within a tolerance of 3 mm: where the mask allows them,
    /// and elsewhere.
    fn slips(size: (usize, usize), count: usize) -> (usize, usize) {
        const TOLERANCE_MM: f64 = 3.0;
        let rig = rig(size);
        let golden = golden(&rig, size, |u, v| RIB.seen(&rig, (u, v), Vector::default()));
        let reach = phase_reach(&rig, &golden, TOLERANCE_MM);
        // With the rib everywhere in the mask, nothing would be tested.
        let safe = reach.iter().filter(|reach| **reach < 0.4).count();
        assert!(safe * 10 > 7 * reach.len(), "{safe} of {}", reach.len());
        let (mut unseen, mut seen) = (0, 0);
        for by in moves(count, TOLERANCE_MM) {
            for (at, reach) in reach.iter().enumerate() {
                let pixel = (at % size.0, at / size.0);
                let here = phase(&rig, pixel, RIB.seen(&rig, pixel, by));
                if (here - golden.phase[at].turns()).abs() >= 0.5 {
                    match *reach < 0.4 {
                        true => unseen += 1,
                        false => seen += 1,
                    }
                }
            }
        }
        (unseen, seen)
    }

    #[test]
    fn a_narrow_rib_is_not_stepped_over() {
        let (unseen, seen) = slips((256, 24), 60);
        assert_eq!(unseen, 0);
        assert!(seen > 1000, "{seen}");
    }

    #[test]
    #[ignore = "takes minutes: `.ci/run full`"]
    fn a_narrow_rib_is_not_stepped_over_in_a_whole_frame() {
        let (unseen, seen) = slips((1456, 1088), 60);
        assert_eq!(unseen, 0);
        assert!(seen > 50_000, "{seen}");
    }

    #[test]
    fn the_reach_is_that_of_moves_in_all_directions() {
        // Wider than MAX_CELLS pixels, too.
        for tolerance in [0.0, 1.0, 8.0] {
            let size = (160, 24);
            let rig = rig(size);
            // A plane that is tilted by half: its points' z is x / 2.
            let seen = |(u, v): (usize, usize), by: Vector| {
                let mut z = 0.0;
                for _ in 0..40 {
                    let point = rig.point(u, v, Height::from_mm(z)).unwrap();
                    z = (point.x - by.x) / 2.0 + by.z;
                }
                z
            };
            let golden = golden(&rig, size, |u, v| seen((u, v), Vector::default()));
            let reach = phase_reach(&rig, &golden, tolerance);
            let (row, columns) = (12, 60..100);
            // Across the plane, and others.
            let across = Vector::new(-0.5, 0.0, 1.0) * (tolerance / libm::sqrt(1.25));
            let mut all = moves(50, tolerance);
            all.extend([across, across * -1.0]);
            for u in columns {
                let at = row * size.0 + u;
                let change = |by: &Vector| {
                    let here = phase(&rig, (u, row), seen((u, row), *by));
                    (here - golden.phase[at].turns()).abs()
                };
                let most = all.iter().map(change).fold(0.0, f64::max);
                let reach = f64::from(reach[at]);
                assert!(most <= reach + 1e-4, "{tolerance}: {most} {reach}");
                assert!(reach <= 1.15 * most + 1e-4, "{tolerance}: {most} {reach}");
            }
        }
    }
}
