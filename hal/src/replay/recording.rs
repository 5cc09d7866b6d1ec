//! A recording, loaded completely and checked: frames of a camera with everything that is needed to
//! measure from them.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::manifest::{self, CodeEntry, Manifest, PatternEntry};
use super::{RecordingError, Wrong, check, grey};
use crate::frame::{Frame, FrameFormat};
use crate::model::DeviceModel;
use crate::npy::{self, Element};
use crate::units::Timestamp;

pub use super::manifest::{RecipeReference, RecordedProjector};

/// Name of the manifest in a recording's folder.
pub(crate) const MANIFEST: &str = "recording.json";
/// Longest manifest that is read; 1024 frames need a tenth of it.
const MAX_MANIFEST_BYTES: u64 = 4 << 20;
/// Longest frame or array that is read.
const MAX_FILE_BYTES: u64 = 4 << 30;
/// Names of the ground truth's files in a recording's folder.
pub(crate) const TRUTH_HEIGHT: &str = "truth/height.npy";
pub(crate) const TRUTH_CLASS: &str = "truth/class.npy";

/// The phase function Φ_P(ξ, η) of a pattern, in turns.
#[derive(Clone, Debug, PartialEq)]
pub enum PatternSpec {
    /// Φ_P = fringes · ξ / width.
    Vertical {
        /// Fringes over the projector's width.
        fringes: f64,
    },
    /// Φ_P = fringes · η / height.
    Horizontal {
        /// Fringes over the projector's height.
        fringes: f64,
    },
    /// Φ_P sampled at every projector pixel.
    File {
        /// Projector rows.
        rows: usize,
        /// Projector columns.
        columns: usize,
        /// Φ_P row by row, turns, finite.
        turns: Vec<f64>,
    },
}

/// One frame of a recording, and the ratio and shift of the pattern that the projector showed:
/// I_max/2 · (1 + f(ratio · Φ_P + shift)), with the projector's brightest grey I_max and f(x) = sin
/// 2πx, or that and harmonics with a peak of 1.
#[derive(Clone, Debug)]
pub struct RecordedFrame {
    /// The level's share of the full phase function, above 0.
    pub ratio: f64,
    /// Phase shift in turns.
    pub shift_turns: f64,
    /// Harmonics of the projected waveform, each with its order and its amplitude as a share of the
    /// fundamental's; none for a sine.
    pub harmonics: Vec<(u8, f64)>,
    /// Index into the recording's patterns.
    pub pattern: usize,
    /// Start of the exposure, if it was recorded, in ns of the recording head's clock.
    pub timestamp_ns: Option<u64>,
    /// The image; its sequence number (`count`) is the frame's place in the manifest, from 0.
    pub frame: Frame,
}

/// The pictures of a Gray code: cell c of the projector shows the bits of c ^ (c >> 1), or of c if
/// it is `binary`.
#[derive(Clone, Debug)]
pub struct RecordedCode {
    /// Index of the pattern whose fringes it numbers: cells lie along ξ for a vertical one, along η
    /// for a horizontal one.
    pub pattern: usize,
    /// Width of a cell in projector pixels.
    pub cell_px: f64,
    /// How far before the raster's edge the first cell begins, projector pixels.
    pub offset_px: f64,
    /// Whether the cells' numbers are written in plain binary instead of a Gray code.
    pub binary: bool,
    /// Whether bits that are set are dark.
    pub inverted: bool,
    /// One picture per bit, the most significant first.
    pub bits: Vec<Frame>,
    /// The inverse picture of each bit, or none.
    pub inverse: Vec<Frame>,
}

/// A recording of version 1 to 3, checked.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Camera columns.
    pub width: u32,
    /// Camera rows.
    pub height: u32,
    /// Significant bits of a sample, 8…16.
    pub bit_depth: u8,
    /// One line about what was recorded.
    pub description: String,
    /// What looked wrong when it was imported, each in a sentence.
    pub notes: Vec<String>,
    /// Where it came from, and its licence.
    pub source: String,
    /// The camera's geometry, if it is known.
    pub camera_model: Option<DeviceModel>,
    /// Standard deviation of one sample in counts, if it is known.
    pub noise_counts: Option<f64>,
    /// The projector.
    pub projector: RecordedProjector,
    /// One or two patterns, for example vertical and horizontal fringes. Heights are from the one
    /// whose phase changes most with them.
    pub patterns: Vec<PatternSpec>,
    /// The frames in the order of the manifest; none of a recording of Gray codes alone.
    pub frames: Vec<RecordedFrame>,
    /// Gray codes, at most one per pattern.
    pub codes: Vec<RecordedCode>,
    /// The scene under a white raster.
    pub white: Option<Frame>,
    /// The scene under a black raster.
    pub black: Option<Frame>,
    /// Lowest and highest z of the working range in mm, if it was stated.
    pub range_mm: Option<[f64; 2]>,
    /// Exposure of one frame in µs.
    pub exposure_us: Option<f64>,
    /// PART_ID of the part that was measured.
    pub part_id: Option<String>,
    /// The recipe that it was measured with.
    pub recipe: Option<RecipeReference>,
    /// True z in mm on each pixel's central ray, row by row; NaN where camera and projector do not
    /// both see the part.
    pub truth_height: Option<Vec<f32>>,
    /// 0 unseen, 1 pixel centre lit, 2 whole pixel lit and no depth edge inside; row by row.
    pub truth_class: Option<Vec<u8>>,
}

impl Recording {
    /// A recording of frames of this format in front of this projector; nothing else is known of it
    /// yet.
    pub fn new(format: FrameFormat, projector: RecordedProjector) -> Self {
        Self {
            width: format.width,
            height: format.height,
            bit_depth: format.bit_depth,
            description: String::new(),
            notes: Vec::new(),
            source: String::new(),
            camera_model: None,
            noise_counts: None,
            projector,
            patterns: Vec::new(),
            frames: Vec::new(),
            codes: Vec::new(),
            white: None,
            black: None,
            range_mm: None,
            exposure_us: None,
            part_id: None,
            recipe: None,
            truth_height: None,
            truth_class: None,
        }
    }

    /// Loads and checks the recording in `folder`.
    ///
    /// # Errors
    /// [`RecordingError::Missing`] if the folder or its manifest is not there,
    /// [`RecordingError::Content`] for everything else, naming the file and the remedy.
    pub fn open(folder: &Path) -> Result<Self, RecordingError> {
        let missing = |path: &Path, what| RecordingError::Missing {
            path: path.to_path_buf(),
            what,
        };
        if !folder.is_dir() {
            return Err(missing(folder, "folder"));
        }
        let path = folder.join(MANIFEST);
        if !path.exists() {
            return Err(missing(&path, MANIFEST));
        }
        let text = String::from_utf8(read(folder, MANIFEST, MAX_MANIFEST_BYTES)?)
            .map_err(|_| Wrong::new("the file is not UTF-8 text", "mend the file").at(&path))?;
        let manifest = manifest::parse(&text)
            .and_then(|manifest| check::manifest(&manifest).map(|()| manifest))
            .map_err(|wrong| wrong.at(&path))?;

        let format = FrameFormat::packed(
            manifest.camera.width,
            manifest.camera.height,
            manifest.camera.bit_depth,
        );
        let frames = frames(folder, &manifest, format)?;
        let patterns = patterns(folder, &manifest)?;
        let codes = codes(folder, &manifest, format)?;
        let uniform = |key, file: &Option<String>| {
            let file = file.as_ref();
            let picture = file.map(|file| picture(folder, key, file, format));
            picture.transpose()
        };
        let white = uniform("white", &manifest.white)?;
        let black = uniform("black", &manifest.black)?;
        let shape = (format.height as usize, format.width as usize);
        let truth_height = truth(folder, TRUTH_HEIGHT, shape)?;
        let truth_class = truth(folder, TRUTH_CLASS, shape)?;

        let camera = manifest.camera;
        Ok(Self {
            width: camera.width,
            height: camera.height,
            bit_depth: camera.bit_depth,
            description: manifest.description,
            notes: manifest.notes,
            source: manifest.source,
            camera_model: camera.model,
            noise_counts: camera.noise_counts,
            projector: manifest.projector,
            patterns,
            frames,
            codes,
            white,
            black,
            range_mm: manifest.range_mm,
            exposure_us: manifest.exposure_us,
            part_id: manifest.part_id,
            recipe: manifest.recipe,
            truth_height,
            truth_class,
        })
    }

    /// The format that every frame of the recording has.
    #[must_use]
    pub fn format(&self) -> FrameFormat {
        FrameFormat::packed(self.width, self.height, self.bit_depth)
    }
}

fn frames(
    folder: &Path,
    manifest: &Manifest,
    format: FrameFormat,
) -> Result<Vec<RecordedFrame>, RecordingError> {
    let mut frames = Vec::with_capacity(manifest.frames.len());
    for (place, entry) in manifest.frames.iter().enumerate() {
        let timestamp = Timestamp(entry.timestamp_ns.unwrap_or(0));
        let frame = frame(folder, &entry.file, format, timestamp, place as u64)?;
        frames.push(RecordedFrame {
            ratio: entry.ratio,
            shift_turns: entry.shift_turns,
            harmonics: entry.harmonics.clone(),
            pattern: entry.pattern,
            timestamp_ns: entry.timestamp_ns,
            frame,
        });
    }
    Ok(frames)
}

/// A frame of the folder.
fn frame(
    folder: &Path,
    file: &str,
    format: FrameFormat,
    timestamp: Timestamp,
    count: u64,
) -> Result<Frame, RecordingError> {
    let path = folder.join(file);
    let bytes = read(folder, file, MAX_FILE_BYTES)?;
    let pixels = grey::decode(&bytes, &format).map_err(|wrong| wrong.at(&path))?;
    Frame::new(format, Arc::new(pixels), timestamp, count)
        .map_err(|error| Wrong::new(error.to_string(), "save the frame again").at(&path))
}

/// A picture that is no frame of a level, under this key of the manifest.
fn picture(
    folder: &Path,
    key: &str,
    file: &str,
    format: FrameFormat,
) -> Result<Frame, RecordingError> {
    let found = frame(folder, file, format, Timestamp(0), 0);
    found.map_err(|error| match error {
        RecordingError::Content { path, wrong } => wrong.under(key).at(&path),
        missing @ RecordingError::Missing { .. } => missing,
    })
}

fn codes(
    folder: &Path,
    manifest: &Manifest,
    format: FrameFormat,
) -> Result<Vec<RecordedCode>, RecordingError> {
    let pictures = |key, files: &[String]| -> Result<Vec<Frame>, RecordingError> {
        let files = files.iter();
        files
            .map(|file| picture(folder, key, file, format))
            .collect()
    };
    let load = |entry: &CodeEntry| {
        Ok(RecordedCode {
            pattern: entry.pattern,
            cell_px: entry.cell_px,
            offset_px: entry.offset_px,
            binary: entry.binary,
            inverted: entry.inverted,
            bits: pictures("bits", &entry.bits)?,
            inverse: pictures("inverse", &entry.inverse)?,
        })
    };
    manifest.codes.iter().map(load).collect()
}

fn patterns(folder: &Path, manifest: &Manifest) -> Result<Vec<PatternSpec>, RecordingError> {
    let rows = manifest.projector.height as usize;
    let columns = manifest.projector.width as usize;
    let load = |entry: &PatternEntry| match entry {
        PatternEntry::Vertical { fringes } => Ok(PatternSpec::Vertical { fringes: *fringes }),
        PatternEntry::Horizontal { fringes } => Ok(PatternSpec::Horizontal { fringes: *fringes }),
        PatternEntry::File { file } => {
            let turns: Vec<f64> = array(folder, file, (rows, columns), "projector")?;
            if let Some(at) = turns.iter().position(|turns| !turns.is_finite()) {
                let (row, column) = (at / columns, at % columns);
                return Err(Wrong::new(
                    format!("the phase at row {row}, column {column} is not finite"),
                    "give every projector pixel a phase",
                )
                .at(&folder.join(file)));
            }
            Ok(PatternSpec::File {
                rows,
                columns,
                turns,
            })
        }
    };
    manifest.pattern.0.iter().map(load).collect()
}

fn truth<T: Element>(
    folder: &Path,
    name: &str,
    shape: (usize, usize),
) -> Result<Option<Vec<T>>, RecordingError> {
    let there = folder.join(name).exists();
    there
        .then(|| array(folder, name, shape, "camera"))
        .transpose()
}

/// The elements of an array of the folder, which must have the shape of the device's pixels.
fn array<T: Element>(
    folder: &Path,
    name: &str,
    (rows, columns): (usize, usize),
    device: &str,
) -> Result<Vec<T>, RecordingError> {
    let path = folder.join(name);
    let array = npy::read(&read(folder, name, MAX_FILE_BYTES)?)
        .map_err(|error| Wrong::new(error.problem, error.remedy).at(&path))?;
    if (array.rows, array.columns) == (rows, columns) {
        return Ok(array.elements);
    }
    Err(Wrong::new(
        format!(
            "expected the {device}'s {rows} rows × {columns} columns, got {}×{}",
            array.rows, array.columns
        ),
        format!("correct the {device}'s size in {MANIFEST} or replace the array"),
    )
    .at(&path))
}

/// Reads one file of the folder. It must be a regular file of at most `limit` bytes, and must not
/// be reached through a link that leads out of the folder.
fn read(folder: &Path, name: &str, limit: u64) -> Result<Vec<u8>, RecordingError> {
    let path = folder.join(name);
    let wrong = |problem: String, remedy: &str| Wrong::new(problem, remedy).at(&path);
    let failed = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => wrong(
            "the file is missing".to_owned(),
            "copy the whole recording again, or take the file out of the manifest",
        ),
        _ => wrong(
            format!("the file cannot be read ({error})"),
            "check the file and its permissions",
        ),
    };
    let real = |path: &Path| fs::canonicalize(path).map_err(failed);
    if !real(&path)?.starts_with(real(folder)?) {
        return Err(wrong(
            "the file is a link out of the folder".to_owned(),
            "copy the file itself",
        ));
    }
    let length = fs::metadata(&path).map_err(failed)?;
    if !length.is_file() || length.len() > limit {
        return Err(wrong(
            format!("not a plain file of at most {limit} bytes"),
            "replace it by a file as the recording format requires",
        ));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(length.len()).unwrap_or(0));
    fs::File::open(&path)
        .and_then(|file| file.take(limit).read_to_end(&mut bytes))
        .map_err(failed)?;
    Ok(bytes)
}
