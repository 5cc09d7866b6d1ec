//! Point clouds as binary PLY, as CloudCompare, MeshLab and Open3D open them.

use algo::geometry::{Pinhole, Triangulator, Vector};
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

/// The frame of coordinates in which a cloud is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Axes {
    /// The world: z up from the plane z = 0.
    #[default]
    World,
    /// The camera: x right, y down, z forward, as OpenCV has it.
    Camera,
}

impl Axes {
    /// A point of the world in this frame.
    fn place(self, camera: &Pinhole, point: Vector) -> [f64; 3] {
        match self {
            Self::World => [point.x, point.y, point.z],
            Self::Camera => {
                let model = camera.model();
                let Vector { x, y, z } = point;
                std::array::from_fn(|row| {
                    let [a, b, c] = std::array::from_fn(|at| model.rotation[3 * row + at]);
                    a * x + b * y + c * z + model.translation[row]
                })
            }
        }
    }

    /// What the file says of its coordinates.
    fn comment(self) -> &'static str {
        match self {
            Self::World => "heights above the plane z = 0, units mm",
            Self::Camera => "in the camera's frame: x right, y down, z forward, units mm",
        }
    }
}

/// Which pixels a cloud has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Pixels {
    /// Those with a height.
    #[default]
    Resolved,
    /// All, row by row, NaN where there is no height: an organised cloud.
    All,
}

/// A binary little-endian PLY: one vertex per pixel with float x, y, z in mm, uchar intensity and
/// float sigma (σ_z in mm, NaN where not known).
///
/// `heights` are row-major in rows of `width` pixels; `shade` gives intensity and σ_z of the pixel
/// of an index.
pub fn ply(
    triangulator: &Triangulator,
    (axes, pixels): (Axes, Pixels),
    width: usize,
    heights: impl ExactSizeIterator<Item = Height>,
    shade: impl Fn(usize) -> (u8, f32),
) -> Vec<u8> {
    // As readers of organised clouds expect it.
    let grid = match pixels {
        Pixels::Resolved => String::new(),
        Pixels::All => {
            let rows = heights.len() / width.max(1);
            format!("obj_info num_cols {width}\nobj_info num_rows {rows}\n")
        }
    };
    let found = |(at, height)| {
        let point = triangulator.point(at % width, at / width, height);
        (point.is_some() || pixels == Pixels::All).then_some((at, point))
    };
    let points: Vec<_> = heights.enumerate().filter_map(found).collect();
    let count = points.len();
    let mut ply = format!(
        "ply\nformat binary_little_endian 1.0\ncomment {}\n{grid}\
         element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar intensity\nproperty float sigma\nend_header\n",
        axes.comment()
    )
    .into_bytes();
    ply.reserve(count * VERTEX_BYTES);
    for (at, point) in points {
        let place = |point| axes.place(triangulator.camera(), point);
        for coordinate in point.map_or([f64::NAN; 3], place) {
            ply.extend_from_slice(&(coordinate as f32).to_le_bytes());
        }
        let (intensity, sigma) = shade(at);
        ply.push(intensity);
        ply.extend_from_slice(&sigma.to_le_bytes());
    }
    ply
}

impl Surface {
    /// The heights as a [`ply`]; `intensity` is one value per pixel, row-major like the heights.
    pub fn ply(&self, form: (Axes, Pixels), intensity: &[u8]) -> Vec<u8> {
        let Self { map, triangulator } = self;
        let heights = map.height.iter().copied();
        ply(triangulator, form, map.width, heights, |at| {
            (intensity.get(at).copied().unwrap_or(0), map.sigma[at])
        })
    }
}

/// Bytes of one vertex.
const VERTEX_BYTES: usize = 4 * 4 + 1;
