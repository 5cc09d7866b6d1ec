//! Epipolar consistency: whether camera and projector still stand to each other as their models
//! say, from the phases of any part.
//!
//! What a camera pixel sees lies on its ray, and the projector sees this ray as a curve, the
//! epipolar line of the pixel (R. Hartley, A. Zisserman, "Multiple View Geometry", 2003, ch. 9). ξ
//! of vertical fringes says where on it the point is; η of horizontal fringes is not needed for the
//! height, so it tests the models: the distance e of (ξ, η) from the line is noise where they are
//! right. A head that was knocked leaves e = a + b·x + c·y over the frame, x and y from −1 to 1: a
//! turn about the line of the centres leaves a = f·angle, one about an optical axis a gradient. A
//! turn in the plane of both axes moves points along the lines and changes e hardly at all: only the
//! height of the reference plane shows it.

use super::PhaseMap;
use crate::geometry::{Pinhole, Vector};
use crate::math::solve::Normal;
use crate::trust::Trust;
use alloc::vec::Vec;

/// Pixels more than this many times the RMS off the first fit are left out of the second: edges of
/// the part, reflections.
const OUTLIER: f64 = 4.0;
/// Least pixels of a fit.
const LEAST: usize = 500;
/// About so many pixels of the frame are sampled: a mean of them has less than a hundredth of their
/// noise.
const MOST: usize = 40_000;
/// Steps along the ray; ξ and η are nearly linear in z.
const STEPS: usize = 4;
/// Step of the numeric derivative along the ray, as a share of the distance.
const SHARE: f64 = 1e-5;

/// Distances of measured projector points from their epipolar lines, projector pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epipolar {
    /// a: mean distance in the middle of the frame.
    pub offset: f64,
    /// b, c: change from the middle to the edges of the frame.
    pub gradient: [f64; 2],
    /// RMS of a + b·x + c·y over the pixels.
    pub rms: f64,
    /// RMS of the pixels about it.
    pub noise: f64,
    /// Pixels that were compared.
    pub pixels: usize,
}

impl Epipolar {
    /// Compares the phases of vertical and horizontal fringes, of `pitch` projector pixels each,
    /// with the models. `None` if fewer than 500 of the pixels looked at are resolved under both.
    pub fn of(
        camera: &Pinhole,
        projector: &Pinhole,
        [vertical, horizontal]: [&PhaseMap; 2],
        pitch: [f64; 2],
    ) -> Option<Self> {
        let width = vertical.width.max(1);
        let height = vertical.phase.len() / width;
        let mut every = 1;
        while (width / every) * (height / every) > MOST {
            every += 1;
        }
        let mut samples = Vec::new();
        for v in (0..height).step_by(every) {
            for u in (0..width).step_by(every) {
                let pixel = v * width + u;
                let turns = |map: &PhaseMap| {
                    let resolved = *map.trust.get(pixel)? == Trust::Resolved;
                    resolved.then(|| map.phase[pixel].turns())
                };
                let (Some(xi), Some(eta)) = (turns(vertical), turns(horizontal)) else {
                    continue;
                };
                let lit_by = (xi * pitch[0], eta * pitch[1]);
                if let Some(off) = off(camera, projector, (u as f64, v as f64), lit_by) {
                    let across = |at: usize, size: usize| 2.0 * at as f64 / size as f64 - 1.0;
                    samples.push([across(u, width), across(v, height), off]);
                }
            }
        }
        let (first, noise) = fit(&samples)?;
        samples.retain(|sample| libm::fabs(sample[2] - at(&first, sample)) <= OUTLIER * noise);
        let (found, noise) = fit(&samples)?;
        let squares = samples.iter().map(|sample| {
            let found = at(&found, sample);
            found * found
        });
        Some(Self {
            offset: found[0],
            gradient: [found[1], found[2]],
            rms: libm::sqrt(squares.sum::<f64>() / samples.len() as f64),
            noise,
            pixels: samples.len(),
        })
    }
}

/// Signed distance of a projector point from the epipolar line of a camera pixel, projector pixels.
fn off(
    camera: &Pinhole,
    projector: &Pinhole,
    (u, v): (f64, f64),
    lit_by: (f64, f64),
) -> Option<f64> {
    let (centre, ray) = (camera.centre(), camera.ray(u, v)?);
    let seen = |far: f64| projector.project(centre + ray * far);
    // The way of a step along the line, and that from the line's point to the measured one.
    let ways = |far: f64| {
        let ((xi, eta), (next_xi, next_eta)) = (seen(far)?, seen(far + SHARE * far)?);
        Some((
            (next_xi - xi, next_eta - eta),
            (lit_by.0 - xi, lit_by.1 - eta),
        ))
    };
    // From the plane z = 0, or from as far away if the ray does not meet it.
    let mut far = centre.z / Vector::new(0.0, 0.0, -1.0).dot(ray).max(1e-3);
    for _ in 0..STEPS {
        let (along, short) = ways(far)?;
        let squares = along.0 * along.0 + along.1 * along.1;
        far += SHARE * far * (short.0 * along.0 + short.1 * along.1) / squares;
    }
    let (along, short) = ways(far)?;
    let across = short.1 * along.0 - short.0 * along.1;
    let off = across / libm::hypot(along.0, along.1);
    off.is_finite().then_some(off)
}

/// a + b·x + c·y of least squares, and the RMS of the samples about it.
fn fit(samples: &[[f64; 3]]) -> Option<([f64; 3], f64)> {
    if samples.len() < LEAST {
        return None;
    }
    let found = Normal::of(samples.iter().map(|&[x, y, off]| ([1.0, x, y], off))).solve()?;
    let squares = samples.iter().map(|sample| {
        let off = sample[2] - at(&found, sample);
        off * off
    });
    let rms = libm::sqrt(squares.sum::<f64>() / samples.len() as f64);
    Some((found, rms))
}

fn at(fit: &[f64; 3], [x, y, _]: &[f64; 3]) -> f64 {
    fit[0] + fit[1] * x + fit[2] * y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PinholeModel;
    use crate::units::AbsolutePhase;
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    const FRAME: (usize, usize) = (160, 120);
    const RASTER: (usize, usize) = (1024, 768);
    const PITCH: f64 = 16.0;
    /// Half width of the uniform noise of ξ and η, projector pixels.
    const NOISE: f64 = 0.2;

    /// A device that looks at the origin from `angle` rad towards +x, turned about its own x, y, z
    /// by small angles.
    fn device(size: (usize, usize), focal: f64, angle: f64, turn: [f64; 3]) -> Pinhole {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let rows = [[cos, 0.0, -sin], [0.0, -1.0, 0.0], [-sin, 0.0, -cos]];
        let [x, y, z] = turn;
        let small = [[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]];
        let mut rotation = [0.0; 9];
        for (at, entry) in rotation.iter_mut().enumerate() {
            *entry = (0..3).map(|k| small[at / 3][k] * rows[k][at % 3]).sum();
        }
        let model = PinholeModel {
            fx: focal,
            fy: focal,
            cx: size.0 as f64 / 2.0,
            cy: size.1 as f64 / 2.0,
            distortion: [-0.1, 0.05, 0.0, 0.0, 0.0],
            rotation,
            translation: small.map(|row| 600.0 * row[2]),
        };
        Pinhole::new(model, size.0, size.1).unwrap()
    }

    fn head(turn: [f64; 3]) -> (Pinhole, Pinhole) {
        (
            device(FRAME, 450.0, 0.35, turn),
            device(RASTER, 1280.0, -0.12, [0.0; 3]),
        )
    }

    /// Phases of a curved part in front of a head; the first rows are not resolved, and a few
    /// pixels are wrong.
    fn phases((camera, projector): &(Pinhole, Pinhole)) -> [PhaseMap; 2] {
        let mut random = SplitMix64::seed_from_u64(3);
        let mut noise = || NOISE * ((random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0);
        let mut maps = [0, 1].map(|_| PhaseMap::new(FRAME.0, FRAME.1));
        for at in 10 * FRAME.0..FRAME.0 * FRAME.1 {
            let (u, v) = ((at % FRAME.0) as f64, (at / FRAME.0) as f64);
            let (centre, ray) = (camera.centre(), camera.ray(u, v).unwrap());
            let height = 20.0 * libm::sin(u / 30.0) * libm::cos(v / 20.0);
            let point = centre + ray * ((height - centre.z) / ray.z);
            let (xi, eta) = projector.project(point).unwrap();
            let wrong = if at % 97 == 0 { 30.0 } else { 0.0 };
            for (map, place) in maps.iter_mut().zip([xi + noise(), eta + wrong + noise()]) {
                map.phase[at] = AbsolutePhase::from_turns(place / PITCH);
                map.trust[at] = Trust::Resolved;
            }
        }
        maps
    }

    fn seen(turn: [f64; 3]) -> Epipolar {
        let [vertical, horizontal] = phases(&head(turn));
        let (camera, projector) = head([0.0; 3]);
        Epipolar::of(&camera, &projector, [&vertical, &horizontal], [PITCH; 2]).unwrap()
    }

    #[test]
    fn a_turn_of_a_twentieth_of_a_degree_is_found_on_any_part_and_a_good_head_is_not() {
        let angle = 0.05_f64.to_radians();
        let good = seen([0.0; 3]);
        assert!(good.rms < 0.01, "{good:?}");
        assert!((good.noise / NOISE - 0.58).abs() < 0.03, "{good:?}");
        let about_x = seen([angle, 0.0, 0.0]);
        // The projector's focal length times the angle.
        assert!(
            (about_x.offset.abs() - 1280.0 * angle).abs() < 0.1,
            "{about_x:?}"
        );
        let about_axis = seen([0.0, 0.0, angle]);
        assert!(
            about_axis.rms > 0.1 && about_axis.gradient[0].abs() > 0.2,
            "{about_axis:?}"
        );
        // In the plane of both axes a turn moves points along their lines.
        assert!(seen([0.0, angle, 0.0]).rms < 0.05);
    }

    #[test]
    fn too_few_pixels_say_nothing() {
        let (camera, projector) = head([0.0; 3]);
        let empty = PhaseMap::new(FRAME.0, FRAME.1);
        assert_eq!(
            Epipolar::of(&camera, &projector, [&empty, &empty], [PITCH; 2]),
            None
        );
    }
}
