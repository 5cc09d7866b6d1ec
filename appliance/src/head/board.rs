//! The name of a checkerboard, `checker:9x13:10`: 9 × 13 inner corners, squares of 10 mm.

use super::calibration::geometry::{MAX_CORNERS, MAX_SQUARE_MM};
use algo::calibration::Board;

/// A board from its name.
///
/// # Errors
/// In words, with the form of a name.
pub fn parse(text: &str) -> Result<Board, String> {
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

/// The name of a board.
pub fn name(board: &Board) -> String {
    format!("checker:{}x{}:{}", board.columns, board.rows, board.square)
}
