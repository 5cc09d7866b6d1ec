//! `fringed backup`: everything that the device has learned in one ZIP, made beside a running station;
//! and the check of one.

use super::names;
use super::options::{Files, Quiet};
use crate::backup::Backups;
use crate::backup::checking::check;
use crate::backup::making::{BackedUpDevice, BackupContents};
use crate::error::{Exit, Result};
use crate::storage::archive::Scratch;
use crate::storage::folder::write_whole_with;
use crate::storage::state::StateFolder;
use crate::system::computing;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::PathBuf;

/// Back up recipes, calibration, history and record of changes, also while a station runs, or check a
/// backup.
#[derive(Debug, clap::Args)]
pub struct Backup {
    /// The backup, NAME.zip; one that is there is replaced.
    #[arg(value_parser = names::file("zip"))]
    file: PathBuf,
    /// Check this backup: hashes, formats, and the database.
    #[arg(long, conflicts_with_all = ["users", "recordings"])]
    check: bool,
    /// With the users and the hashes of their passwords.
    #[arg(long)]
    users: bool,
    /// With the recordings of parts.
    #[arg(long)]
    recordings: bool,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    quiet: Quiet,
}

impl Backup {
    /// Makes or checks it.
    ///
    /// # Errors
    /// If there is no state (66), the backup cannot be written or there is no room to unpack it (73),
    /// or what is checked is damaged or no backup (65).
    pub fn run(&self) -> Result<()> {
        match self.check {
            true => self.checked(),
            false => self.made(),
        }
    }

    fn made(&self) -> Result<()> {
        // A station may be measuring.
        computing::give_way();
        let config = self.files.configuration()?;
        let state = self.files.state_folder()?;
        let what = format!("back up {}", state.display());
        let serial = StateFolder::serial_in(&state).ok_or_else(|| {
            let none = "no station has used it: name its state folder with --state";
            Exit::Missing.because(&what)(none)
        })?;
        let device = BackedUpDevice {
            serial,
            configuration: toml::to_string(&config).unwrap_or_default(),
        };
        let wanted = BackupContents {
            users: self.users,
            recordings: self.recordings,
        };
        let failed = Exit::CannotCreate.failure();
        let taken = Backups::of(&state).snapshot(&device, wanted, &self.files.record()?);
        let taken = taken.map_err(failed)?;
        let written = write_whole_with(&self.file, |file| {
            let buffered = io::BufWriter::new(file);
            taken.write(buffered).map_err(io::Error::other)
        });
        let what = format!("write {}", self.file.display());
        written.map_err(Exit::CannotCreate.advising(what, "free space or name another place"))?;
        let words = || format!("{} is in {}", device.serial, self.file.display());
        self.quiet.say(words);
        Ok(())
    }

    fn checked(&self) -> Result<()> {
        let what = format!("check {}", self.file.display());
        let archive = File::open(&self.file).map_err(Exit::Missing.because(&what))?;
        let scratch = Scratch::new()?;
        let checked = check(archive, &scratch.path().join("backup"));
        let checked = checked.map_err(|error| match error.kind() {
            ErrorKind::StorageFull => Exit::CannotCreate.because(&what)(error),
            _ => Exit::Content.because(&what)(error),
        })?;
        self.quiet.say(|| {
            let results = checked.history.map_or(0, |history| history.results);
            format!(
                "{} is whole: device {}, {} files, {results} results",
                self.file.display(),
                checked.manifest.serial,
                checked.manifest.members.len()
            )
        });
        Ok(())
    }
}
