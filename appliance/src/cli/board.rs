//! `fringed board --out board.pdf`: a checkerboard to print for `fringed calibrate --board`.

use super::names;
use super::options::Quiet;
use crate::error::{Exit, Result};
use crate::head::board;
use crate::output::board::sheet;
use crate::storage::folder::write_whole;
use algo::calibration::Board;
use std::path::PathBuf;

/// Draw a checkerboard to print.
#[derive(Debug, clap::Args)]
pub struct Print {
    /// The board: checker:COLUMNSxROWS:MM, counted in inner corners, MM the side of a square.
    #[arg(long, value_name = "BOARD", value_parser = board::parse, default_value = "checker:9x13:10")]
    board: Board,
    /// The file.
    #[arg(long, value_name = "FILE", value_parser = names::file("pdf"))]
    out: PathBuf,
    #[command(flatten)]
    quiet: Quiet,
}

impl Print {
    /// Writes the file.
    ///
    /// # Errors
    /// If no paper holds the board (64), or the file cannot be written (73).
    pub fn run(&self) -> Result<()> {
        let place = self.out.display();
        let sheet = sheet(&self.board).map_err(Exit::Usage.because(format!("draw {place}")))?;
        let remedy = "free space, or name another file";
        write_whole(&self.out, &sheet.pdf)
            .map_err(Exit::CannotCreate.advising(format!("write {place}"), remedy))?;
        self.quiet.say(|| {
            format!(
                "{place}: print it on {} at 100 %, glue it on something flat, and measure it",
                sheet.paper
            )
        });
        Ok(())
    }
}
