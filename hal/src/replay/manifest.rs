//! The file form of `recording.json`, versions 1 to 3: its keys and types, before any value is
//! checked.

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Wrong;
use crate::bounded;
use crate::bounds::{
    Fields, Longest, MAX_EXPOSURE_US, MAX_NAME, MAX_NOISE_COUNTS, MAX_RANGE_MM, MAX_SHIFT_TURNS,
    MAX_SIDE, MIN_NOISE_COUNTS, RATIOS,
};
use crate::model::{DeviceModel, PlaneModel};

/// The name of the format, in every manifest.
pub const FORMAT: &str = "fringed-recording";
/// The newest version that this program reads. Version 2 has codes, white and black; version 3
/// notes, and codes with an offset or another coding. A recording is written as the first version
/// that has what it holds, so that older programs read it.
pub const VERSION: u64 = 3;
/// Longest description and note, characters.
const MAX_TEXT: usize = 4096;

bounded! {
    /// The whole of `recording.json`.
    pub(crate) struct Manifest {
        pub format: String,
        pub version: u64,
        #[serde(default)]
        pub description: String = Longest(MAX_TEXT),
        #[serde(default)]
        pub source: String = Longest(MAX_TEXT),
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub notes: Vec<String> = Longest(MAX_TEXT),
        pub camera: CameraEntry = Fields,
        pub projector: RecordedProjector = Fields,
        pub pattern: PatternEntries,
        pub frames: Vec<FrameEntry>,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub codes: Vec<CodeEntry>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub white: Option<String>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub black: Option<String>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub range_mm: Option<[f64; 2]> = -MAX_RANGE_MM..=MAX_RANGE_MM,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub exposure_us: Option<f64> = 1e-3..=MAX_EXPOSURE_US,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub part_id: Option<String> = Longest(MAX_NAME),
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub recipe: Option<RecipeReference> = Fields,
    }

    pub(crate) struct CameraEntry {
        pub width: u32 = 1..=MAX_SIDE,
        pub height: u32 = 1..=MAX_SIDE,
        pub bit_depth: u8 = 8..=16,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub model: Option<DeviceModel>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub noise_counts: Option<f64> = MIN_NOISE_COUNTS..=MAX_NOISE_COUNTS,
    }

    /// The projector of a recording.
    pub struct RecordedProjector {
        /// Columns.
        pub width: u32 = 1..=MAX_SIDE,
        /// Rows.
        pub height: u32 = 1..=MAX_SIDE,
        /// Its geometry, if it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub model: Option<DeviceModel>,
        /// What the projector points of the plane z = 0 are off the models, where heights go by the
        /// measured ones.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub plane: Option<PlaneModel> = Fields,
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum PatternEntry {
    Vertical { fringes: f64 },
    Horizontal { fringes: f64 },
    File { file: String },
}

bounded! {
    pub(crate) struct FrameEntry {
        pub file: String,
        pub ratio: f64 = RATIOS[0]..=RATIOS[1],
        pub shift_turns: f64 = -MAX_SHIFT_TURNS..=MAX_SHIFT_TURNS,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub timestamp_ns: Option<u64>,
        #[serde(default, skip_serializing_if = "is_first")]
        pub pattern: usize,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub harmonics: Vec<(u8, f64)>,
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CodeEntry {
    #[serde(default, skip_serializing_if = "is_first")]
    pub pattern: usize,
    pub cell_px: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset_px: f64,
    #[serde(default, skip_serializing_if = "is_not")]
    pub binary: bool,
    #[serde(default, skip_serializing_if = "is_not")]
    pub inverted: bool,
    pub bits: Vec<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inverse: Vec<String>,
}

impl CodeEntry {
    /// Whether it is a Gray code from the raster's edge on, bright where a bit is set, as version 2
    /// knows it.
    pub fn is_plain(&self) -> bool {
        is_zero(&self.offset_px) && !self.binary && !self.inverted
    }
}

impl Manifest {
    /// The first version of the format that has what this manifest holds.
    pub fn least_version(&self) -> u64 {
        let later = !self.notes.is_empty() || !self.codes.iter().all(CodeEntry::is_plain);
        match (later, self.pictures().next()) {
            (true, _) => VERSION,
            (false, Some(_)) => 2,
            (false, None) => 1,
        }
    }

    /// The files of all pictures that are not frames of levels, each with its key.
    pub fn pictures(&self) -> impl Iterator<Item = (&'static str, &String)> {
        let coded = self.codes.iter().flat_map(|code| {
            let bits = code.bits.iter().map(|file| ("bits", file));
            bits.chain(code.inverse.iter().map(|file| ("inverse", file)))
        });
        let white = self.white.iter().map(|file| ("white", file));
        let black = self.black.iter().map(|file| ("black", file));
        coded.chain(white).chain(black)
    }
}

bounded! {
    /// The recipe of a measurement in production.
    #[derive(Eq)]
    pub struct RecipeReference {
        /// Recipe number.
        pub number: u32 = 1..=9999,
        /// Fingerprint of the recipe's content, as the recipe states it.
        pub fingerprint: String,
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_first(pattern: &usize) -> bool {
    *pattern == 0
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_not(flag: &bool) -> bool {
    !*flag
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(px: &f64) -> bool {
    *px == 0.0
}

/// One pattern, or a list of them.
///
/// Not an untagged enum, because serde's error for a wrong key in one does not name the key.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PatternEntries(pub Vec<PatternEntry>);

impl Serialize for PatternEntries {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.as_slice() {
            [pattern] => pattern.serialize(serializer),
            several => several.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for PatternEntries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrList;
        impl<'de> Visitor<'de> for OneOrList {
            type Value = PatternEntries;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a pattern or a list of patterns")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let pattern = PatternEntry::deserialize(MapAccessDeserializer::new(map))?;
                Ok(PatternEntries(vec![pattern]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(PatternEntries)
            }
        }
        deserializer.deserialize_any(OneOrList)
    }
}

/// Reads the manifest in `text`.
///
/// Format and version are checked first, so that a newer version is reported as such and not as
/// unknown keys.
pub(crate) fn parse(text: &str) -> Result<Manifest, Wrong> {
    // Editors on Windows put a byte order mark in front.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let value: serde_json::Value = serde_json::from_str(text)
        .map_err(|error| Wrong::new(format!("not valid JSON: {error}"), "mend the file"))?;
    match value.get("format").and_then(|name| name.as_str()) {
        Some(FORMAT) => {}
        Some(other) => {
            return Err(Wrong::new(
                format!("format is {other:?}, expected {FORMAT:?}"),
                "name a folder that holds a recording",
            ));
        }
        None => {
            return Err(Wrong::new(
                "the key format is missing or no text",
                format!("write \"format\": {FORMAT:?}"),
            ));
        }
    }
    match value.get("version").and_then(serde_json::Value::as_u64) {
        Some(1..=VERSION) => {}
        Some(newer) if newer > VERSION => {
            return Err(Wrong::new(
                format!("version {newer} is newer than this program reads ({VERSION})"),
                "update fringed",
            ));
        }
        _ => {
            return Err(Wrong::new(
                "the key version is missing or no whole number from 1",
                "write \"version\": 1",
            ));
        }
    }
    serde_json::from_str(text).map_err(|error| {
        Wrong::new(
            error.to_string(),
            "correct or remove that key; docs/formats.md lists the keys of recordings",
        )
    })
}
