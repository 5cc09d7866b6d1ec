//! `fringed board --out board.pdf`: a checkerboard to print for `fringed calibrate --board`.

use super::names;
use super::options::Quiet;
use crate::error::{Exit, Failure};
use crate::head::calibration::geometry::{MAX_CORNERS, MAX_SQUARE_MM};
use crate::output::board::sheet;
use crate::storage::folder::write_whole;
use algo::calibration::Board;
use std::path::PathBuf;

/// Draw a checkerboard to print.
#[derive(Debug, clap::Args)]
pub struct Print {
    /// The board: checker:COLUMNSxROWS:MM, counted in inner corners, MM the side of a square.
    #[arg(long, value_name = "BOARD", value_parser = board, default_value = "checker:9x13:10")]
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
    pub fn run(&self) -> Result<(), Failure> {
        let place = self.out.display();
        let sheet = sheet(&self.board)
            .map_err(|error| Failure::because(Exit::Usage, format!("draw {place}"), error))?;
        write_whole(&self.out, &sheet.pdf).map_err(|error| {
            let words = format!("{error}: free space, or name another file");
            Failure::because(Exit::CannotCreate, format!("write {place}"), words)
        })?;
        self.quiet.say(|| {
            format!(
                "{place}: print it on {} at 100 %, glue it on something flat, and measure it",
                sheet.paper
            )
        });
        Ok(())
    }
}

/// A board from its description.
pub(super) fn board(text: &str) -> Result<Board, String> {
    let parsed = || {
        let (counts, square) = text.strip_prefix("checker:")?.split_once(':')?;
        let (columns, rows) = counts.split_once('x')?;
        Some(Board {
            columns: columns.parse().ok()?,
            rows: rows.parse().ok()?,
            square: square.parse().ok()?,
        })
    };
    let inside = |board: &Board| {
        let counts = 3..=MAX_CORNERS;
        counts.contains(&board.columns)
            && counts.contains(&board.rows)
            && (1e-3..=MAX_SQUARE_MM).contains(&board.square)
    };
    let board = parsed().filter(inside).ok_or_else(|| {
        format!("write checker:9x13:10 for 9 × 13 inner corners (3 to {MAX_CORNERS}) and squares of 10 mm")
    })?;
    if board.columns == board.rows {
        return Err("take a board with different numbers of columns and rows: with equal numbers, x and y could be confused".into());
    }
    Ok(board)
}
