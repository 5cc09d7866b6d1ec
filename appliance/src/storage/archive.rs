//! A ZIP that came from elsewhere: its directory is checked before any member is read, and a recording
//! is unpacked from it for as long as it is needed.
//!
//! A directory of a few kilobytes can name the same bytes thousands of times. Here a ZIP has no more
//! members than its format needs, no two members share a byte, and all are stored without compression:
//! reading all of them costs as much as reading the file once.

use crate::error::{Exit, Failure, Result};
use std::fmt::Display;
use std::fs::{self, DirBuilder, File};
use std::io::{self, Cursor, Read, Seek, SeekFrom, Write as _};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Component, Path, PathBuf};
use zip::read::ZipFile;
use zip::result::{ZipError, ZipResult};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Bytes of the record that ends a ZIP without a comment (APPNOTE 6.3.10, section 4.3.16).
const END_BYTES: usize = 22;
const END_MAGIC: &[u8; 4] = b"PK\x05\x06";

/// How members are stored: without compression.
pub fn stored() -> SimpleFileOptions {
    SimpleFileOptions::default().compression_method(CompressionMethod::Stored)
}

/// A ZIP of these members.
///
/// # Errors
/// If it cannot be made.
pub fn packed<'a>(
    members: impl IntoIterator<Item = (&'a str, impl AsRef<[u8]>)>,
    room: usize,
) -> ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::with_capacity(room)));
    for (name, content) in members {
        zip.start_file(name, stored())?;
        zip.write_all(content.as_ref())?;
    }
    Ok(zip.finish()?.into_inner())
}

/// Why a ZIP is not read.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The file cannot be read.
    #[error("read its end: {0}")]
    End(io::Error),
    /// It does not end as a ZIP does.
    #[error("it is no ZIP, or was cut off")]
    NoZip,
    /// It has more members than its format needs.
    #[error("it lists {listed} members where at most {most} belong in it")]
    TooMany {
        /// How many it has.
        listed: usize,
        /// How many it may have.
        most: usize,
    },
    /// Two members have one name.
    #[error("two of its members have the same name")]
    SameName,
    /// Two members share bytes.
    #[error("its members overlap: it was made by hand or damaged")]
    Overlap,
    /// The member of this name is not stored as it is.
    #[error("member {0:?} is compressed or encrypted: pack it without compression (zip -0)")]
    Compressed(String),
    /// Its directory is damaged.
    #[error("{0}")]
    Directory(#[from] ZipError),
}

/// The members of a ZIP, by name; folders are left out.
#[derive(Debug)]
pub struct Members<R> {
    zip: ZipArchive<R>,
    /// Names in ascending order, each with its place in the directory.
    places: Vec<(String, usize)>,
    /// Whether it has folders or links as well.
    others: bool,
}

impl<R: Read + Seek> Members<R> {
    /// Opens a ZIP of at most `most` members (folders count). Takes memory for the directory only.
    ///
    /// # Errors
    /// It is not a ZIP, has too many members, two of one name or two that share bytes, or one is
    /// compressed.
    pub fn open(mut source: R, most: usize) -> Result<Self, ArchiveError> {
        let listed = listed(&mut source).map_err(ArchiveError::End)?;
        let listed = listed.ok_or(ArchiveError::NoZip)?;
        if listed > most {
            return Err(ArchiveError::TooMany { listed, most });
        }
        let mut zip = ZipArchive::new(source)?;
        // Of two members with one name the library keeps the last.
        if zip.len() != listed {
            return Err(ArchiveError::SameName);
        }
        if zip.has_overlapping_entries()? {
            return Err(ArchiveError::Overlap);
        }
        let mut places = Vec::with_capacity(listed);
        for place in 0..listed {
            let entry = zip.by_index_data(place)?;
            let name = entry.name()?.into_owned();
            let stored = entry.compression() == CompressionMethod::Stored
                && entry.size() == entry.compressed_size();
            if !stored || entry.encrypted() {
                return Err(ArchiveError::Compressed(name));
            }
            if entry.is_file() {
                places.push((name, place));
            }
        }
        places.sort();
        let others = places.len() != listed;
        Ok(Self {
            zip,
            places,
            others,
        })
    }

    /// Whether it has members that are no files: folders or links.
    pub fn has_others(&self) -> bool {
        self.others
    }

    /// The names, ascending.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.places.iter().map(|(name, _)| name.as_str())
    }

    /// A member, to be read; its size is that of its content.
    ///
    /// # Errors
    /// There is no such member, or the file cannot be read.
    pub fn member(&mut self, name: &str) -> io::Result<ZipFile<'_, R>> {
        let absent = || io::Error::new(io::ErrorKind::NotFound, format!("it holds no {name}"));
        let found = self
            .places
            .binary_search_by(|(known, _)| known.as_str().cmp(name));
        let (_, place) = &self.places[found.map_err(|_| absent())?];
        Ok(self.zip.by_index(*place)?)
    }

    /// The whole content of a member.
    ///
    /// # Errors
    /// There is no such member, it has more than `most` bytes, or it was cut off or damaged.
    pub fn content(&mut self, name: &str, most: u64) -> io::Result<Vec<u8>> {
        let mut member = self.member(name)?;
        let size = member.size();
        if size > most {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                format!("it has {size} bytes where at most {most} are read"),
            ));
        }
        let mut content = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
        member.read_to_end(&mut content)?;
        Ok(content)
    }
}

/// The number of members in the record at the end; `None` if the file does not end in such a record
/// with the directory right before it. A ZIP with a comment or with 64-bit sizes is refused: this
/// program writes neither.
fn listed(source: &mut (impl Read + Seek)) -> io::Result<Option<usize>> {
    let size = source.seek(SeekFrom::End(0))?;
    let Some(start) = size.checked_sub(END_BYTES as u64) else {
        return Ok(None);
    };
    source.seek(SeekFrom::Start(start))?;
    let mut end = [0; END_BYTES];
    source.read_exact(&mut end)?;
    let short = |at: usize| u16::from_le_bytes([end[at], end[at + 1]]);
    let long = |at: usize| u64::from(short(at)) | u64::from(short(at + 2)) << 16;
    let one_disk = long(4) == 0 && short(8) == short(10);
    let plain = end.starts_with(END_MAGIC) && one_disk && short(20) == 0;
    // Otherwise the library would look for another record further up.
    let abuts = long(12) + long(16) == start;
    Ok((plain && abuts).then_some(usize::from(short(8))))
}

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
pub struct Scratch(PathBuf);

impl Scratch {
    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// A new one.
    ///
    /// # Errors
    /// If it cannot be created (73).
    pub fn new() -> Result<Self> {
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
    use std::time::Instant;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

    fn stored(members: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        for (name, content) in members {
            zip.start_file(*name, options).unwrap();
            zip.write_all(content).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    /// A ZIP of one member, listed `count` times under names of its own.
    fn overlapping(bytes: usize, count: u16) -> Vec<u8> {
        let one = stored(&[("m00000.npy", &vec![0; bytes])]);
        let start = one.len() - END_BYTES - 46 - 10;
        let (members, entry) = (&one[..start], &one[start..one.len() - END_BYTES]);
        let mut zip = members.to_vec();
        for at in 0..count {
            zip.extend_from_slice(&entry[..46]);
            zip.extend_from_slice(format!("m{at:05}.npy").as_bytes());
        }
        let directory = (zip.len() - start) as u32;
        zip.extend_from_slice(END_MAGIC);
        zip.extend_from_slice(&[0; 4]);
        zip.extend_from_slice(&count.to_le_bytes());
        zip.extend_from_slice(&count.to_le_bytes());
        zip.extend_from_slice(&directory.to_le_bytes());
        zip.extend_from_slice(&(start as u32).to_le_bytes());
        zip.extend_from_slice(&[0; 2]);
        zip
    }

    fn refused(zip: &[u8], most: usize) -> String {
        Members::open(Cursor::new(zip), most)
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn members_are_read_whole_by_name_and_folders_are_none() {
        let zip = stored(&[("b/2", b"two"), ("a", b"one"), ("b/", b"")]);
        let mut members = Members::open(Cursor::new(zip), 3).unwrap();
        assert_eq!(members.names().collect::<Vec<_>>(), ["a", "b/2"]);
        assert_eq!(members.content("b/2", 3).unwrap(), b"two");
        let long = members.content("a", 2).unwrap_err().to_string();
        assert!(long.contains("3 bytes"), "{long}");
        let absent = members.content("c", 9).unwrap_err();
        assert_eq!(absent.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn four_megabytes_of_overlapping_members_are_refused_without_reading_them_again_and_again() {
        let times = [2, 9, 2000, 60_000].map(|count| {
            let zip = overlapping(4_000_000 - 56 * usize::from(count), count);
            let most = if count < 10 { 9 } else { usize::MAX };
            let began = Instant::now();
            let words = refused(&zip, most);
            assert!(words.contains("overlap"), "{words}");
            began.elapsed()
        });
        // 30 times as many members; the square of that is 900.
        assert!(times[3] < 200 * times[2], "{times:?}");
        let words = refused(&overlapping(1000, 10), 9);
        assert!(words.contains("10 members"), "{words}");
    }

    #[test]
    fn what_ends_in_another_way_than_a_zip_is_refused_and_any_cut_of_one_too() {
        let zip = stored(&[("a", b"one"), ("b", b"two")]);
        for length in 0..zip.len() {
            Members::open(Cursor::new(&zip[..length]), 2).unwrap_err();
        }
        let mut commented = zip.clone();
        let end = commented.len() - 2;
        commented[end] = 4;
        commented.extend_from_slice(b"note");
        assert!(refused(&commented, 2).contains("no ZIP"));
        let in_front = [b"#!/bin/sh\n", &zip[..]].concat();
        assert!(refused(&in_front, 2).contains("no ZIP"));
    }

    #[test]
    fn changed_bytes_of_a_zip_never_panic() {
        let zip = stored(&[("a", b"one"), ("b", b"two")]);
        for at in 0..zip.len() {
            for value in [0, 1, 0x7F, 0x80, 0xFF] {
                let mut changed = zip.clone();
                changed[at] = value;
                if let Ok(mut members) = Members::open(Cursor::new(changed), 2) {
                    let names: Vec<String> = members.names().map(str::to_owned).collect();
                    for name in names {
                        // A member that was damaged is an error of its checksum.
                        drop(members.content(&name, 1 << 20));
                    }
                }
            }
        }
    }

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
