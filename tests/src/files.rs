//! Reading the files that the program writes, with libraries other than the program's own code.

use appliance::recipe::RecipeFile;
use appliance::recipe::file::archive::{Arrays, unpack};
use hal::npy::Array;
use std::io::Cursor;
use std::path::Path;

/// SHA-256 in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    use sha2::Digest as _;
    let hash = sha2::Sha256::digest(bytes);
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The manifest and the arrays of a recipe's file, to be changed and packed again.
pub fn recipe(bytes: &[u8]) -> (RecipeFile, Arrays) {
    unpack(Cursor::new(bytes), bytes.len() as u64).expect("a whole recipe")
}

/// Reads a `.npy` of `f32`.
pub fn array(path: &Path) -> Array<f32> {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    hal::npy::read(&bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Reads the elements of a `.npy` of `u8`.
pub fn flags(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    hal::npy::read(&bytes).expect("elements of u8").elements
}

/// The model of a device as OpenCV writes it (YAML); `unit` is a millimetre in the file's unit of
/// length.
pub fn opencv(model: &hal::model::DeviceModel, unit: f64) -> String {
    let matrix = |name: &str, rows: usize, numbers: &[f64]| {
        let columns = numbers.len() / rows;
        format!(
            "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {numbers:?}\n"
        )
    };
    let k = [
        model.fx, 0.0, model.cx, 0.0, model.fy, model.cy, 0.0, 0.0, 1.0,
    ];
    let t = model.translation_mm.map(|mm| mm * unit);
    [
        "%YAML:1.0\n---\n".to_owned(),
        matrix("K", 3, &k),
        matrix("D", 1, &model.distortion),
        matrix("R", 3, &model.rotation),
        matrix("T", 3, &t),
    ]
    .concat()
}

/// A decoded picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Samples per pixel.
    pub channels: usize,
    /// Samples, row by row.
    pub samples: Vec<u16>,
}

/// Decodes a PNG.
pub fn picture(path: &Path) -> Picture {
    let file = std::fs::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut reader = png::Decoder::new(std::io::BufReader::new(file))
        .read_info()
        .expect("a PNG");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut bytes).expect("a whole PNG");
    let samples = match info.bit_depth {
        png::BitDepth::Sixteen => bytes
            .chunks_exact(2)
            .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
            .collect(),
        png::BitDepth::Eight => bytes.iter().map(|byte| u16::from(*byte)).collect(),
        other => panic!("a depth of {other:?}"),
    };
    Picture {
        width: info.width as usize,
        height: info.height as usize,
        channels: info.color_type.samples(),
        samples,
    }
}

/// A vertex of a point cloud.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// x, y, z in mm.
    pub point: [f32; 3],
    /// Grey level.
    pub intensity: u8,
    /// σ_z in mm.
    pub sigma: f32,
}

/// Reads a cloud in the form that docs/formats.md states: binary little-endian PLY with float x, y,
/// z, uchar intensity, float sigma.
pub fn cloud(path: &Path) -> Vec<Vertex> {
    const END: &[u8] = b"end_header\n";
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let end = bytes
        .windows(END.len())
        .position(|window| window == END)
        .expect("a header with an end");
    let header = std::str::from_utf8(&bytes[..end]).expect("a header of text");
    let lines: Vec<&str> = header
        .lines()
        .filter(|line| !line.starts_with("comment"))
        .collect();
    let count: usize = lines[2]
        .strip_prefix("element vertex ")
        .and_then(|count| count.parse().ok())
        .expect("a number of vertices");
    assert_eq!(lines[..2], ["ply", "format binary_little_endian 1.0"]);
    assert_eq!(
        lines[3..],
        [
            "property float x",
            "property float y",
            "property float z",
            "property uchar intensity",
            "property float sigma",
        ]
    );
    let body = &bytes[end + END.len()..];
    assert_eq!(body.len(), 17 * count, "bytes of {count} vertices");
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    body.chunks_exact(17)
        .map(|vertex| Vertex {
            point: [float(vertex), float(&vertex[4..]), float(&vertex[8..])],
            intensity: vertex[12],
            sigma: float(&vertex[13..]),
        })
        .collect()
}

/// The report of a measurement.
pub fn report(folder: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(folder.join("report.json")).expect("a report");
    serde_json::from_str(&text).expect("a report in JSON")
}

/// The names in a folder, sorted; empty if there is none.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .map(|entry| {
            let name = entry.expect("an entry").file_name();
            name.to_string_lossy().into_owned()
        })
        .collect();
    names.sort();
    names
}
