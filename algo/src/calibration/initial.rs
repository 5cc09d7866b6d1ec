//! First values of the adjustment, in closed form.
//!
//! Camera: homographies H from the board to the picture; with the principal point in the middle,
//! each gives two linear equations for 1/f_x² and 1/f_y² (Z. Zhang, "A flexible new technique for
//! camera calibration", PAMI 22, 2000, eqs. 3–4), then the board's pose. Projector: all points of
//! all poses are then known in the camera's coordinates and do not lie in one plane, so that its 3
//! × 4 matrix follows from linear equations (Y. I. Abdel-Aziz, H. M. Karara, "Direct linear
//! transformation", 1971), and from that its lens and pose (R. Hartley, A. Zisserman, "Multiple
//! View Geometry", section 6.2.4). The projector's lens may be shifted.

use super::board::Board;
use super::rig::Pose;
use crate::geometry::{Lens, Vector};
use crate::math::solve::Normal;
use alloc::vec::Vec;

/// A corner's place on the board and in the picture.
pub(super) type Correspondence = ((f64, f64), (f64, f64));

/// The columns of H from places on the board to places in the picture, both about their centres and
/// of the order of 1: then its last element is not 0 and is set to 1.
fn homography(pairs: impl Iterator<Item = Correspondence>) -> Option<[Vector; 3]> {
    let equations = pairs.flat_map(|((x, y), (u, v))| {
        [
            ([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u),
            ([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v),
        ]
    });
    let h = Normal::of(equations).solve()?;
    Some([
        Vector::new(h[0], h[3], h[6]),
        Vector::new(h[1], h[4], h[7]),
        Vector::new(h[2], h[5], 1.0),
    ])
}

/// Lens of the camera and poses of the board, from the corners of each pose in a picture of `width`
/// × `height` pixels. `None` if no pose is tilted, so that they do not determine the lens.
pub(super) fn camera(
    board: &Board,
    (width, height): (usize, usize),
    poses: &[Vec<Correspondence>],
) -> Option<(Lens, Vec<Pose>)> {
    let (cx, cy) = ((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0);
    let (scale, size) = (
        cx.max(cy).max(1.0),
        board.square * board.columns.max(board.rows) as f64,
    );
    let mut equations = Normal::default();
    let mut homographies = Vec::with_capacity(poses.len());
    for pairs in poses {
        let scaled = pairs
            .iter()
            .map(|&((x, y), (u, v))| ((x / size, y / size), ((u - cx) / scale, (v - cy) / scale)));
        let h = homography(scaled)?;
        let [a, b, _] = h;
        // Both columns have about the length of the board's picture; equal weight for all poses.
        let weight = 1.0 / (a.dot(a) + b.dot(b));
        equations.add(
            &[a.x * b.x * weight, a.y * b.y * weight],
            -a.z * b.z * weight,
        );
        let differ = (a.z * a.z - b.z * b.z) * weight;
        equations.add(
            &[
                (a.x * a.x - b.x * b.x) * weight,
                (a.y * a.y - b.y * b.y) * weight,
            ],
            -differ,
        );
        homographies.push(h);
    }
    let [x, y] = equations.solve()?;
    let focal = |inverse_square: f64| {
        (inverse_square > 1e-4 && inverse_square < 1e4).then(|| libm::sqrt(1.0 / inverse_square))
    };
    let (fx, fy) = (focal(x)?, focal(y)?);
    let poses = homographies.into_iter().map(|h| {
        let [x, y, t] = h.map(|h| Vector::new(h.x / fx, h.y / fy, h.z));
        let length = size * 2.0 / (x.length() + y.length());
        Pose::from_axes(x, y, t * length)
    });
    let lens = Lens {
        fx: fx * scale,
        fy: fy * scale,
        cx,
        cy,
        distortion: [0.0; 5],
    };
    Some((lens, poses.collect()))
}

/// How the raster of a mirrored projector becomes one that is not mirrored, without a turn of more
/// than 45° about its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mirrored {
    /// One axis is reversed.
    Axis,
    /// ξ and η are exchanged.
    Swapped,
}

/// Lens and pose of the projector, from points in the camera's coordinates and the projector pixels
/// that light them. A mirrored picture of either device has no such pose: the error says how.
/// `None` if the points do not determine it.
pub(super) fn projector(points: &[(Vector, (f64, f64))]) -> Option<Result<(Lens, Pose), Mirrored>> {
    let n = points.len().max(1) as f64;
    let centre = points
        .iter()
        .fold(Vector::default(), |sum, (point, _)| sum + *point)
        * (1.0 / n);
    let spread = points
        .iter()
        .map(|(point, _)| (*point - centre).length())
        .sum::<f64>()
        / n;
    let pixels = points
        .iter()
        .fold((0.0, 0.0), |sum, (_, p)| (sum.0 + p.0 / n, sum.1 + p.1 / n));
    let far = |p: &(f64, f64)| libm::hypot(p.0 - pixels.0, p.1 - pixels.1);
    let scale = points.iter().map(|(_, p)| far(p)).sum::<f64>() / n;
    if !(spread > 0.0 && scale > 0.0) {
        return None;
    }
    let equations = points.iter().flat_map(|(point, pixel)| {
        let p = (*point - centre) * (1.0 / spread);
        let (u, v) = ((pixel.0 - pixels.0) / scale, (pixel.1 - pixels.1) / scale);
        let (o, i) = (0.0, 1.0);
        let along = [p.x, p.y, p.z, i, o, o, o, o, -u * p.x, -u * p.y, -u * p.z];
        let down = [o, o, o, o, p.x, p.y, p.z, i, -v * p.x, -v * p.y, -v * p.z];
        [(along, u), (down, v)]
    });
    let m = Normal::of(equations).solve()?;
    let row = |at: usize| Vector::new(m[at], m[at + 1], m[at + 2]);
    let (a, b, c) = (row(0), row(4), row(8));
    // M = λK[R|t] in the scaled coordinates, with λ·depth of the centre = 1: R's last row is c/λ.
    let size = c.length();
    let z = c * (1.0 / size);
    let (cx, cy) = (a.dot(z) / size, b.dot(z) / size);
    let (x, y) = (a * (1.0 / size) + z * -cx, b * (1.0 / size) + z * -cy);
    let (fx, fy) = (x.length(), y.length());
    let turn = Pose::from_axes(x, y, Vector::default()).inverse();
    // Rasters lie like the camera's rows, or upside down.
    if !(x.cross(y).dot(z) > 0.0) {
        let along_rows = libm::fabs(x.x) >= libm::fabs(x.y);
        return Some(Err(if along_rows {
            Mirrored::Axis
        } else {
            Mirrored::Swapped
        }));
    }
    let depth = 1.0 / size;
    let shift = Vector::new(
        (m[3] / size - cx * depth) / fx,
        (m[7] / size - cy * depth) / fy,
        depth,
    );
    let rows = turn.rows;
    let about_centre = Pose {
        rows,
        shift: shift * spread,
    };
    let lens = Lens {
        fx: fx * scale,
        fy: fy * scale,
        cx: cx * scale + pixels.0,
        cy: cy * scale + pixels.1,
        distortion: [0.0; 5],
    };
    let back = about_centre.turned(centre);
    Some(Ok((
        lens,
        Pose {
            rows,
            shift: about_centre.shift - back,
        },
    )))
}
