//! Unpacks a recording from the ZIP that the page gives, for as long as it is needed.

use crate::error::{Exit, Failure, Result};
use crate::storage::archive::Members;
use std::fmt::Display;
use std::fs::{self, DirBuilder, File};
use std::io;
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Component, Path, PathBuf};

/// The most members that are unpacked. A recording has at most 1030 files: 1024 frames, the phase
/// functions of up to two patterns, two maps of the ground truth, a manifest and a recipe. The rest
/// is for entries of folders and for files that other programs add.
const MOST_MEMBERS: usize = 2048;
/// What a recording's folder must hold.
const MANIFEST: &str = "recording.json";

/// The folder of a recording; what was unpacked for it is removed when this is dropped.
#[derive(Debug)]
pub struct Unpacked {
    folder: PathBuf,
    name: Option<String>,
    _scratch: Option<Scratch>,
}

impl Unpacked {
    /// The recording at `path`: a folder as it is, a ZIP unpacked into a temporary folder.
    ///
    /// # Errors
    /// If a file is not a ZIP of a recording (65), or there is no room to unpack it (73).
    pub fn of(path: &Path) -> Result<Self> {
        if !path.is_file() {
            let real = path.canonicalize().ok();
            return Ok(Self {
                folder: path.to_path_buf(),
                name: real.as_deref().and_then(name_of),
                _scratch: None,
            });
        }
        let wrong = |error: &dyn Display| {
            let words = "name a recording's folder, or the ZIP that the page gives";
            let what = format!("unpack {}", path.display());
            Failure::new(Exit::Content, format!("{what}: {error}: {words}"))
        };
        let file = File::open(path).map_err(|error| wrong(&error))?;
        let mut zip = Members::open(file, MOST_MEMBERS).map_err(|error| wrong(&error))?;
        let names: Vec<String> = zip.names().map(str::to_owned).collect();
        if let Some(name) = names.iter().find(|name| !is_inside(name)) {
            return Err(wrong(&format!("member {name:?} does not lie inside of it")));
        }
        let scratch = Scratch::new()?;
        for name in names {
            let target = scratch.0.join(&name);
            let made = target.parent().map_or(Ok(()), fs::create_dir_all);
            let copied = made
                .and_then(|()| io::copy(&mut zip.member(&name)?, &mut File::create_new(&target)?));
            copied.map_err(|error| match error.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::PermissionDenied => {
                    let what = format!("unpack {} into {}", path.display(), target.display());
                    let words = format!(
                        "{error}: make room and allow writing there, or unpack it elsewhere and name that folder"
                    );
                    Failure::because(Exit::CannotCreate, what, words)
                }
                _ => wrong(&format!("member {name}: {error}")),
            })?;
        }
        let folder = root(&scratch.0).ok_or_else(|| wrong(&format!("it holds no {MANIFEST}")))?;
        Ok(Self {
            name: name_of(&folder).filter(|_| folder != scratch.0),
            folder,
            _scratch: Some(scratch),
        })
    }

    /// The recording's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The recording's name, by which the history knows it.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }
}

fn name_of(folder: &Path) -> Option<String> {
    Some(folder.file_name()?.to_string_lossy().into_owned())
}

/// Where the manifest lies: in the folder itself, or in the one folder that holds everything.
fn root(folder: &Path) -> Option<PathBuf> {
    if folder.join(MANIFEST).is_file() {
        return Some(folder.to_path_buf());
    }
    let mut entries = fs::read_dir(folder).ok()?.flatten();
    let only = entries.next()?.path();
    (entries.next().is_none() && only.join(MANIFEST).is_file()).then_some(only)
}

fn is_inside(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.contains(['\\', '\0']) && parts.all(|part| matches!(part, Component::Normal(_)))
}

/// A temporary folder that other users cannot read; it is removed when this is dropped.
#[derive(Debug)]
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Self> {
        let name = format!("fringed-{:08x}", crate::storage::state::random()?);
        let folder = std::env::temp_dir().join(name);
        let failed = Exit::CannotCreate.because(format!("create {}", folder.display()));
        DirBuilder::new()
            .mode(0o700)
            .create(&folder)
            .map_err(failed)?;
        Ok(Self(folder))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed is left to the system, which clears its temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write as _};
    use zip::CompressionMethod;
    use zip::write::SimpleFileOptions;

    fn zip(members: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        for (name, content) in members {
            zip.start_file(*name, stored).unwrap();
            zip.write_all(content).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    fn unpack(bytes: &[u8]) -> Result<Unpacked> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.zip");
        fs::write(&path, bytes).unwrap();
        Unpacked::of(&path)
    }

    #[test]
    fn a_zip_is_unpacked_whole_knows_its_name_and_leaves_nothing_behind() {
        let bytes = zip(&[
            ("0000000042-0003-fail/recording.json", b"{}"),
            ("0000000042-0003-fail/frames/000.png", b"frame"),
        ]);
        let unpacked = unpack(&bytes).unwrap();
        assert_eq!(unpacked.name(), Some("0000000042-0003-fail"));
        let folder = unpacked.folder().to_path_buf();
        assert_eq!(fs::read(folder.join("frames/000.png")).unwrap(), b"frame");
        drop(unpacked);
        assert!(!folder.parent().unwrap().exists());
        // Packed again by hand, without the folder around it.
        let unpacked = unpack(&zip(&[("recording.json", b"{}")])).unwrap();
        assert!(unpacked.name().is_none() && unpacked.folder().join("recording.json").exists());
    }

    #[test]
    fn a_zip_that_reaches_out_or_is_no_recording_is_refused_with_the_remedy() {
        for name in [
            "../recording.json",
            "/recording.json",
            "a/../../b",
            "a\\..\\b",
        ] {
            let failure = unpack(&zip(&[(name, b"{}")])).unwrap_err();
            assert_eq!(failure.exit, Exit::Content, "{name}: {failure}");
            assert!(
                failure.to_string().contains("does not lie inside"),
                "{failure}"
            );
        }
        let twice = zip(&[("recording.json", b"{}"), ("recording.json/frame", b"x")]);
        let many: Vec<String> = (0..=MOST_MEMBERS).map(|at| at.to_string()).collect();
        let many: Vec<(&str, &[u8])> = many.iter().map(|name| (&**name, &b""[..])).collect();
        let mut damaged = zip(&[("recording.json", b"{\"format\"")]);
        let content = damaged
            .windows(3)
            .position(|three| three == b"{\"f")
            .unwrap();
        damaged[content] ^= 1;
        for (bytes, words) in [
            (zip(&many), "at most 2048"),
            (twice, "recording.json"),
            (damaged, "checksum"),
            (zip(&[("frames/000.png", b"x")]), "holds no recording.json"),
            (b"no ZIP".to_vec(), "unpack"),
            (Vec::new(), "unpack"),
        ] {
            let failure = unpack(&bytes).unwrap_err();
            assert_eq!(failure.exit, Exit::Content, "{words}: {failure}");
            assert!(
                failure.to_string().contains(words)
                    && failure.to_string().contains("name a recording's"),
                "{words}: {failure}"
            );
        }
    }

    #[test]
    fn a_folder_is_taken_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let unpacked = Unpacked::of(folder.path()).unwrap();
        assert_eq!(unpacked.folder(), folder.path());
        let name = folder.path().file_name().unwrap().to_str();
        assert_eq!(unpacked.name(), name);
    }
}
