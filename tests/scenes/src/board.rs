//! A checkerboard in front of a camera and a projector, rendered to recordings without models.

use crate::once::Once;
use crate::random::Random;
use serde_json::json;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

/// Columns and rows of the camera's frames.
pub const FRAME: (usize, usize) = (420, 360);
/// Columns and rows of the projector's raster.
pub const RASTER: (usize, usize) = (640, 480);
/// Focal lengths of camera and projector, px.
pub const FOCAL: (f64, f64) = (900.0, 950.0);
/// Centre of the projector in the camera's coordinates, mm. Its axis meets the camera's 400 mm
/// away.
pub const PROJECTOR: [f64; 3] = [150.0, 0.0, 20.0];
/// Inner corners and side of a square, mm.
pub const BOARD: (usize, usize, f64) = (6, 8, 10.0);
/// Fringes over the raster.
const FRINGES: f64 = 16.0;
/// Rays per pixel along each axis.
const SUB: usize = 3;

/// One pose of the board in the camera's coordinates, and what is wrong with it.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Turn about x, then about y, then about the board's normal, rad.
    pub turn: [f64; 3],
    /// Centre of the board, mm.
    pub centre: [f64; 3],
    /// Side of a ray bundle in pixels; 1 is a sharp picture.
    pub blur: f64,
    /// By how much the board has moved along x before the horizontal fringes, mm.
    pub moved: f64,
    /// Columns of the raster that are dark, from the left.
    pub dark: f64,
    /// Whether the projector's picture is mirrored.
    pub mirrored: bool,
}

impl Pose {
    /// A good pose.
    pub fn new(turn: [f64; 3], centre: [f64; 3]) -> Self {
        Self {
            turn,
            centre,
            blur: 1.0,
            moved: 0.0,
            dark: 0.0,
            mirrored: false,
        }
    }
}

/// Six poses, the last nearly across the camera's axis.
pub fn poses() -> [Pose; 6] {
    [
        Pose::new([0.4, 0.1, 0.1], [5.0, -4.0, 380.0]),
        Pose::new([-0.4, 0.2, -0.1], [-6.0, 5.0, 400.0]),
        Pose::new([0.1, 0.45, 0.3], [2.0, 6.0, 420.0]),
        Pose::new([-0.1, -0.4, 0.0], [0.0, -5.0, 390.0]),
        Pose::new([0.3, -0.3, -0.2], [-4.0, 0.0, 430.0]),
        Pose::new([0.03, -0.02, 0.05], [0.0, 0.0, 400.0]),
    ]
}

type V = [f64; 3];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn less(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn turned([x, y, z]: V, [a, b, c]: V) -> V {
    let (x, y) = (x * c.cos() - y * c.sin(), x * c.sin() + y * c.cos());
    let (x, z) = (x * b.cos() + z * b.sin(), z * b.cos() - x * b.sin());
    [x, y * a.cos() - z * a.sin(), y * a.sin() + z * a.cos()]
}

/// Where the board and the projector look, in the camera's coordinates.
struct View {
    /// Along columns and rows of the board, and its normal.
    board: [V; 3],
    centre: V,
    /// Across, down and along the axis of the projector.
    projector: [V; 3],
}

impl View {
    /// Of a board that has moved along x by `shift`.
    fn new(pose: &Pose, shift: f64) -> Self {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        // The projector's axis goes through (0, 0, 400).
        let z = less([0.0, 0.0, 400.0], PROJECTOR);
        let z = z.map(|along| along / dot(z, z).sqrt());
        let across = [z[2], 0.0, -z[0]];
        let across = across.map(|along| along / dot(across, across).sqrt());
        let down = [
            z[1] * across[2] - z[2] * across[1],
            z[2] * across[0] - z[0] * across[2],
            z[0] * across[1] - z[1] * across[0],
        ];
        Self {
            board: axes.map(|axis| turned(axis, pose.turn)),
            centre: less(pose.centre, [-shift, 0.0, 0.0]),
            projector: [across, down, z],
        }
    }

    /// Albedo and projector pixel of what a ray of the camera meets; `None` beside the board.
    fn met(&self, (x, y): (f64, f64)) -> Option<(f64, f64, f64)> {
        let [along_columns, along_rows, normal] = self.board;
        let ray = [x, y, 1.0];
        let far = dot(normal, self.centre) / dot(normal, ray);
        let point = ray.map(|along| along * far);
        let on_board = less(point, self.centre);
        let (columns, rows, square) = BOARD;
        let side =
            |axis: V, corners: usize| dot(axis, on_board) / square + (corners as f64 - 1.0) / 2.0;
        let (column, row) = (side(along_columns, columns), side(along_rows, rows));
        let within = |at: f64, corners: usize, margin: f64| {
            at > -1.0 - margin && at < corners as f64 + margin
        };
        if !(within(column, columns, 0.8) && within(row, rows, 0.8)) {
            return None;
        }
        let squares = within(column, columns, 0.0) && within(row, rows, 0.0);
        let black = squares && (column.floor() + row.floor()) as i64 % 2 != 0;
        let [across, down, z] = self.projector;
        let from = less(point, PROJECTOR);
        let pixel = |axis: V, size: usize| {
            FOCAL.1 * dot(axis, from) / dot(z, from) + (size as f64 - 1.0) / 2.0
        };
        Some((
            if black { 0.3 } else { 0.9 },
            pixel(across, RASTER.0),
            pixel(down, RASTER.1),
        ))
    }
}

/// What is projected, vertical first, then horizontal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projected {
    /// Three shifts of one and of sixteen fringes.
    #[default]
    Geometric,
    /// Three shifts of fifteen and of sixteen fringes.
    Heterodyne,
    /// Three shifts of sixteen fringes, and a Gray code of 32 cells.
    Gray,
}

/// Bits of the Gray code.
const BITS: u32 = 5;

impl Projected {
    /// The light of each frame at a phase of the sixteen fringes, 0 to 1.
    fn light(self, phase: f64) -> Vec<f64> {
        let sines = |fringes: f64| {
            let turns = phase * fringes / FRINGES;
            (0..3).map(move |k| 0.5 + 0.5 * (TAU * (turns + f64::from(k) / 3.0)).sin())
        };
        match self {
            Self::Geometric => sines(1.0).chain(sines(FRINGES)).collect(),
            Self::Heterodyne => sines(FRINGES - 1.0).chain(sines(FRINGES)).collect(),
            Self::Gray => {
                let cells = f64::from(1_u32 << BITS);
                let cell = (phase / FRINGES * cells).clamp(0.0, cells - 1.0) as u32;
                let code = cell ^ (cell >> 1);
                let bits = (0..BITS).rev().map(|bit| f64::from(code >> bit & 1));
                sines(FRINGES).chain(bits).collect()
            }
        }
    }

    /// Ratio and shift of each frame that is no bit of a code.
    fn levels(self) -> Vec<(f64, f64)> {
        let ratios = match self {
            Self::Geometric => vec![1.0 / FRINGES, 1.0],
            Self::Heterodyne => vec![1.0 - 1.0 / FRINGES, 1.0],
            Self::Gray => vec![1.0],
        };
        let shifts = |ratio| (0..3).map(move |k| (ratio, f64::from(k) / 3.0));
        ratios.into_iter().flat_map(shifts).collect()
    }
}

/// Writes the recording of a pose into a new folder: three shifts of one and of sixteen fringes,
/// vertical, then horizontal.
pub fn write(pose: &Pose, seed: u64, folder: &Path) {
    write_as(pose, Projected::Geometric, seed, folder);
}

/// As [`write()`], under something else.
pub fn write_as(pose: &Pose, projected: Projected, seed: u64, folder: &Path) {
    /// Of each pose, light and seed the frames of both patterns, which several tests write.
    static RENDERED: Once<String, [Vec<Vec<u8>>; 2]> = Once::new();
    fs::create_dir_all(folder.join("frames")).expect("the folder can be made");
    let (mut entries, mut codes) = (Vec::new(), Vec::new());
    let dark = projected.light(0.0).len();
    let rendered = RENDERED.get(format!("{pose:?} {projected:?} {seed}"), || {
        let mut random = Random::new(seed);
        [0, 1].map(|pattern| {
            let shift = if pattern == 0 { 0.0 } else { pose.moved };
            seen(pose, shift, dark, &mut random, |xi, eta| {
                let phase = [xi / RASTER.0 as f64, eta / RASTER.1 as f64][pattern] * FRINGES;
                projected.light(phase)
            })
        })
    });
    for (pattern, frames) in rendered.iter().enumerate() {
        let files: Vec<String> = (0..dark)
            .map(|at| format!("frames/{pattern}-{at}.png"))
            .collect();
        for (file, counts) in files.iter().zip(frames) {
            png(&folder.join(file), counts);
        }
        let levels = projected.levels();
        for ((ratio, shift), file) in levels.iter().zip(&files) {
            entries.push(
                json!({ "file": file, "pattern": pattern, "ratio": ratio, "shift_turns": shift }),
            );
        }
        if files.len() > levels.len() {
            let length = [RASTER.0, RASTER.1][pattern] as f64;
            let cell = length / f64::from(1_u32 << BITS);
            codes.push(
                json!({ "pattern": pattern, "cell_px": cell, "bits": files[levels.len()..] }),
            );
        }
    }
    let mut manifest = json!({
        "format": "fringed-recording", "version": 1,
        "camera": { "width": FRAME.0, "height": FRAME.1, "bit_depth": 8 },
        "projector": { "width": RASTER.0, "height": RASTER.1 },
        "pattern": [{ "kind": "vertical", "fringes": FRINGES }, { "kind": "horizontal", "fringes": FRINGES }],
        "frames": entries,
    });
    if !codes.is_empty() {
        (manifest["version"], manifest["codes"]) = (json!(2), json!(codes));
    }
    fs::write(folder.join("recording.json"), manifest.to_string()).expect("it can be written");
}

/// Writes the pictures of a pose under a Gray code of the columns, 9 bits of cells of so many
/// pixels, and of the rows, 8 bits, into a new folder: each bit followed by its inverse, then white
/// and black.
pub fn write_codes(pose: &Pose, seed: u64, cell: f64, folder: &Path) {
    fs::create_dir_all(folder).expect("the folder can be made");
    let mut random = Random::new(seed);
    let bits = [9_usize, 8];
    let codes = 2 * (bits[0] + bits[1]);
    let light = |frame: usize, xi: f64, eta: f64| {
        if frame >= codes {
            return if frame == codes { 1.0 } else { 0.0 };
        }
        let (along, count, first) = match frame < 2 * bits[0] {
            true => (xi, bits[0], 0),
            false => (eta, bits[1], 2 * bits[0]),
        };
        let cell = ((along + 0.5) / cell).max(0.0) as u32;
        let bit = count - 1 - (frame - first) / 2;
        let set = (cell ^ cell >> 1) >> bit & 1 == 1;
        f64::from(u8::from(set == frame.is_multiple_of(2)))
    };
    let count = codes + 2;
    let frames = seen(pose, 0.0, count, &mut random, |xi, eta| {
        (0..count).map(|frame| light(frame, xi, eta)).collect()
    });
    for (at, counts) in frames.iter().enumerate() {
        png(&folder.join(format!("{at:02}.png")), counts);
    }
}

/// So many frames of a pose, moved along x by `shift` mm, under the light that each of them has at
/// a projector pixel.
fn seen(
    pose: &Pose,
    shift: f64,
    count: usize,
    random: &mut Random,
    light: impl Fn(f64, f64) -> Vec<f64>,
) -> Vec<Vec<u8>> {
    let view = View::new(pose, shift);
    let mut frames = vec![Vec::new(); count];
    for at in 0..FRAME.0 * FRAME.1 {
        let mut sums = vec![0.0; count];
        for ray in 0..SUB * SUB {
            let off = |at: usize| pose.blur * ((at as f64 + 0.5) / SUB as f64 - 0.5);
            let place = |at: usize, size: usize, ray: usize| {
                (at as f64 + off(ray) - (size as f64 - 1.0) / 2.0) / FOCAL.0
            };
            let x = place(at % FRAME.0, FRAME.0, ray % SUB);
            let y = place(at / FRAME.0, FRAME.1, ray / SUB);
            let Some((albedo, xi, eta)) = view.met((x, y)) else {
                continue;
            };
            if xi < pose.dark {
                continue;
            }
            let xi = match pose.mirrored {
                true => RASTER.0 as f64 - 1.0 - xi,
                false => xi,
            };
            for (sum, light) in sums.iter_mut().zip(light(xi, eta)) {
                *sum += albedo * light;
            }
        }
        for (frame, sum) in frames.iter_mut().zip(sums) {
            let counts = 12.0 + 210.0 * sum / (SUB * SUB) as f64 + 2.0 * (random.share() - 0.5);
            frame.push(counts.round() as u8);
        }
    }
    frames
}

fn png(path: &Path, counts: &[u8]) {
    let file = fs::File::create(path).expect("it can be written");
    let mut encoder = png::Encoder::new(file, FRAME.0 as u32, FRAME.1 as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().expect("it can be written");
    writer.write_image_data(counts).expect("it can be written");
}
