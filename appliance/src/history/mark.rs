//! The last SEQ in use, in memory that outlives this process but not the system.
//!
//! After kill -9 it says where counting must go on; after a loss of power it is gone, and the reservation on the card says it
//! ([`super::seqs`]). POSIX shared memory is a file that no card is behind: writing to it takes no longer than copying
//! 20 bytes, whatever the card does. Where a system has none, or somebody else owns it, nothing is lost but numbers.

use crate::storage::state::Counted;
use rustix::fs::Mode;
use rustix::shm::{self, OFlags};
use std::fs::File;
use std::io::{self, Read as _};
use std::os::unix::fs::{FileExt as _, MetadataExt as _};

/// The mark of one device.
#[derive(Debug)]
pub struct Mark {
    file: File,
    name: String,
}

impl Mark {
    /// Opens the mark of the device with this serial, or begins it. `owner` is the user that the state folder belongs to.
    ///
    /// # Errors
    /// Whatever the system answers; `PermissionDenied` where it is somebody else's.
    pub fn open(serial: &str, owner: u32) -> io::Result<Self> {
        let (file, name) = open_shared(serial, owner)?;
        Ok(Self { file, name })
    }

    /// What the run before left; none if there is nothing, or half of something.
    pub fn read(&self) -> Option<Counted> {
        let mut text = String::new();
        // From the beginning: nothing was read from this file before.
        (&self.file).read_to_string(&mut text).ok()?;
        Counted::read(&text).filter(|found| found.text() == text)
    }

    /// Says that this SEQ is in use.
    ///
    /// # Errors
    /// Whatever the system answers.
    pub fn write(&self, counted: Counted) -> io::Result<()> {
        self.file.write_all_at(counted.text().as_bytes(), 0)
    }

    /// Takes it away: the card knows the number.
    pub fn remove(&self) {
        remove_shared(&self.name);
    }
}

/// Opens shared memory of a device, or begins it: the memory, and its name in the system.
///
/// # Errors
/// Whatever the system answers; `PermissionDenied` where it does not belong to `owner`.
pub(super) fn open_shared(name: &str, owner: u32) -> io::Result<(File, String)> {
    let plain = |c: &char| c.is_ascii_alphanumeric() || *c == '-';
    let plain: String = name.chars().filter(plain).collect();
    let name = format!("/fringed-{plain}");
    let flags = OFlags::CREATE | OFlags::RDWR;
    let file = File::from(shm::open(&name, flags, Mode::RUSR | Mode::WUSR)?);
    if file.metadata()?.uid() != owner {
        return Err(io::Error::from(io::ErrorKind::PermissionDenied));
    }
    Ok((file, name))
}

/// Removes shared memory by its name.
pub(super) fn remove_shared(name: &str) {
    // Whatever is left of it belongs to no later run.
    let _ = shm::unlink(name);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_outlives_who_wrote_it_and_is_read_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let owner = std::fs::metadata(folder.path()).unwrap().uid();
        let serial = format!("TEST{}", std::process::id());
        let open = || Mark::open(&serial, owner).unwrap();
        assert_eq!(open().read(), None);
        let counted = Counted { last: 17, run: 3 };
        open().write(counted).unwrap();
        assert_eq!(open().read(), Some(counted));
        open().file.set_len(12).unwrap();
        assert_eq!(open().read(), None);
        open().remove();
        assert_eq!(open().read(), None);
        let foreign = Mark::open(&serial, owner + 1).unwrap_err();
        assert_eq!(foreign.kind(), io::ErrorKind::PermissionDenied);
        open().remove();
    }
}
