//! Point clouds as binary PLY, as CloudCompare, MeshLab and Open3D open them.

use crate::measure::Surface;
use algo::units::Height;

/// A binary little-endian PLY: one vertex per resolved pixel with float x, y, z in mm, uchar
/// intensity and float sigma (σ_z in mm, NaN where not known).
///
/// `intensity` is one value per pixel, row-major like the heights.
pub fn ply(surface: &Surface, intensity: &[u8]) -> Vec<u8> {
    let Surface { map, triangulator } = surface;
    let count = map.height.iter().filter(|height| height.is_known()).count();
    let mut ply = format!(
        "ply\nformat binary_little_endian 1.0\ncomment heights above the plane z = 0, units mm\n\
         element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar intensity\nproperty float sigma\nend_header\n"
    )
    .into_bytes();
    ply.reserve(count * VERTEX_BYTES);
    let known = |(_, height): &(usize, &Height)| height.is_known();
    for (at, height) in map.height.iter().enumerate().filter(known) {
        let point = triangulator
            .point(at % map.width, at / map.width, *height)
            .unwrap_or_default();
        for coordinate in [point.x, point.y, point.z] {
            ply.extend_from_slice(&(coordinate as f32).to_le_bytes());
        }
        ply.push(intensity.get(at).copied().unwrap_or(0));
        ply.extend_from_slice(&map.sigma[at].to_le_bytes());
    }
    ply
}

/// Bytes of one vertex.
const VERTEX_BYTES: usize = 4 * 4 + 1;
