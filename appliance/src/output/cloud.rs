//! Point clouds as binary PLY, as CloudCompare, MeshLab and Open3D open them.

use algo::geometry::Triangulator;
use algo::pipeline::HeightMap;
use algo::units::Height;

/// Heights with the geometry that they come from.
#[derive(Debug)]
pub struct Surface {
    /// z and σ_z per pixel.
    pub map: HeightMap,
    /// The rig, for the points behind the heights.
    pub triangulator: Triangulator,
}

/// One point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// x, y, z in mm.
    pub point: [f32; 3],
    /// How bright it is.
    pub intensity: u8,
    /// σ_z in mm, NaN where not known.
    pub sigma: f32,
}

/// A binary little-endian PLY: one vertex per resolved pixel with float x, y, z in mm, uchar
/// intensity and float sigma (σ_z in mm, NaN where not known).
///
/// `intensity` is one value per pixel, row-major like the heights.
pub fn ply(surface: &Surface, intensity: &[u8]) -> Vec<u8> {
    let Surface { map, triangulator } = surface;
    let known = |(_, height): &(usize, &Height)| height.is_known();
    let vertices: Vec<Vertex> = map
        .height
        .iter()
        .enumerate()
        .filter(known)
        .map(|(at, height)| {
            let point = triangulator
                .point(at % map.width, at / map.width, *height)
                .unwrap_or_default();
            Vertex {
                point: [point.x as f32, point.y as f32, point.z as f32],
                intensity: intensity.get(at).copied().unwrap_or(0),
                sigma: map.sigma[at],
            }
        })
        .collect();
    binary_ply(&vertices)
}

/// The same format for any points.
pub fn binary_ply(vertices: &[Vertex]) -> Vec<u8> {
    let count = vertices.len();
    let mut ply = format!(
        "ply\nformat binary_little_endian 1.0\ncomment heights above the plane z = 0, units mm\n\
         element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar intensity\nproperty float sigma\nend_header\n"
    )
    .into_bytes();
    ply.reserve(count * VERTEX_BYTES);
    for vertex in vertices {
        for coordinate in vertex.point {
            ply.extend_from_slice(&coordinate.to_le_bytes());
        }
        ply.push(vertex.intensity);
        ply.extend_from_slice(&vertex.sigma.to_le_bytes());
    }
    ply
}

/// Bytes of one vertex.
const VERTEX_BYTES: usize = 4 * 4 + 1;
