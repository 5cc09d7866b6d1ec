//! The files of a calibration: `calibration.json`, its previous generation, and the phase maps
//! beside them.

use super::file::CalibrationFile;
use crate::error::{Exit, Result};
use crate::storage::folder::{name_also, read_whole, sync_folder_of, write_whole};
use crate::storage::hex;
use sha2::{Digest, Sha256};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The path of the file in a state folder.
pub const IN_STATE: &str = "calibration/calibration.json";
/// Longest file, bytes.
const MAX_BYTES: u64 = 64 << 20;
/// Digits of a map's checksum in its file name, so that maps of two generations never share a name.
const DIGITS: usize = 16;

/// The place of a `calibration.json`.
#[derive(Clone, Debug)]
pub struct CalibrationPlace {
    path: PathBuf,
}

/// A calibration that was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The newest generation that is whole.
    pub file: CalibrationFile,
    /// Why it is the previous generation, where it is.
    pub fallback: Option<String>,
}

/// A reference phase map with the name of its file.
#[derive(Clone, Debug)]
pub struct NamedMap {
    /// The file's name beside `calibration.json`.
    pub file: String,
    /// SHA-256 of the bytes.
    pub sha256: String,
    bytes: Vec<u8>,
}

impl NamedMap {
    /// Names a map by its bytes.
    pub fn new(name: &str, bytes: Vec<u8>) -> Self {
        let sha256 = hex(&Sha256::digest(&bytes));
        Self {
            file: format!("{name}-{}.npy", &sha256[..DIGITS]),
            sha256,
            bytes,
        }
    }
}

impl CalibrationPlace {
    /// A `calibration.json`, which need not be there.
    pub fn at(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn previous(&self) -> PathBuf {
        self.path.with_extension("json.previous")
    }

    /// Reads the newest generation that is whole; none if there never was one.
    ///
    /// # Errors
    /// No generation can be used.
    pub fn load(&self) -> Result<Option<Loaded>> {
        let newest = read(&self.path);
        if let Some(Ok(file)) = newest {
            return Ok(Some(Loaded {
                file,
                fallback: None,
            }));
        }
        let reason = newest.and_then(Result::err);
        let place = self.path.display();
        match (read(&self.previous()), reason) {
            (Some(Ok(file)), reason) => Ok(Some(Loaded {
                file,
                fallback: Some(format!(
                    "calibration {place}: {}; the previous generation is used",
                    reason.map_or("it is missing".into(), |reason| reason.to_string())
                )),
            })),
            (_, Some(reason)) => Exit::Content.fail(format!("calibration {place}: {reason}")),
            (_, None) => Ok(None),
        }
    }

    /// Writes a calibration with its maps and keeps the present one as the previous
    /// generation. After a loss of power at any moment either the old one or the new one is whole:
    /// maps have names of their own, and count only once `calibration.json` names them.
    ///
    /// # Errors
    /// With this remedy, if it cannot be written (73); then the calibration is unchanged.
    pub fn save(&self, bytes: &[u8], maps: &[NamedMap], remedy: &str) -> Result<()> {
        let what = format!("write {}", self.path.display());
        self.write(bytes, maps)
            .map_err(Exit::CannotCreate.advising(what, remedy))
    }

    fn write(&self, bytes: &[u8], maps: &[NamedMap]) -> io::Result<()> {
        let folder = self.folder();
        fs::create_dir_all(folder)?;
        sync_folder_of(folder)?;
        for map in maps {
            write_whole(&folder.join(&map.file), &map.bytes)?;
        }
        self.keep_previous()?;
        write_whole(&self.path, bytes)?;
        self.forget_maps();
        Ok(())
    }

    fn folder(&self) -> &Path {
        let folder = self.path.parent();
        folder
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."))
    }

    /// Makes the current generation the previous one, unless it is damaged: a damaged file never
    /// pushes out a good one.
    fn keep_previous(&self) -> io::Result<()> {
        if !matches!(read(&self.path), Some(Ok(_))) {
            return Ok(());
        }
        // The current one stands until it is replaced.
        name_also(&self.path, &self.previous())
    }

    /// Removes maps that no generation names, and unfinished files. A file that cannot be removed
    /// only takes room.
    fn forget_maps(&self) {
        let generations = [read(&self.path), read(&self.previous())];
        let files = generations.iter().flatten().flatten();
        let named: Vec<&str> = files.flat_map(CalibrationFile::maps).collect();
        for entry in fs::read_dir(self.folder()).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let Some(name) = name.to_str() else { continue };
            let ours = name.starts_with("reference_")
                && (name.ends_with(".npy") || name.ends_with(".npy.new"));
            if ours && !named.contains(&name) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// Reads the calibration in a file, if there is one.
fn read(path: &Path) -> Option<Result<CalibrationFile>> {
    match read_whole(path, MAX_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => {
            Some(Exit::Content.fail(format!("{error}: make it readable, or calibrate anew")))
        }
        Ok(bytes) => Some(CalibrationFile::read(&bytes)),
    }
}
