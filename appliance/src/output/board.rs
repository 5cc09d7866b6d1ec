//! A checkerboard as a PDF: to scale, with its size written on it.
//!
//! Coordinates of a page are in points of 1/72 inch from its lower left corner (ISO 32000-1,
//! 8.3.2.3); `re` and `f` fill a rectangle (8.5.2, 8.5.3), `Tj` shows a text (9.4.3) in one of the
//! 14 standard fonts, which need not be embedded (9.6.2.2).

use crate::error::{Exit, Result};
use algo::calibration::Board;
use std::fmt::Write as _;

/// Points per mm.
const POINTS: f64 = 72.0 / 25.4;
/// Papers with their sizes in mm, ISO 216.
const PAPERS: [(&str, f64, f64); 5] = [
    ("A4", 210.0, 297.0),
    ("A3", 297.0, 420.0),
    ("A2", 420.0, 594.0),
    ("A1", 594.0, 841.0),
    ("A0", 841.0, 1189.0),
];
/// White margin about the squares, mm: printers leave 5 mm blank, and the text stands in it.
const MARGIN: f64 = 15.0;
/// Height of the text, points.
const TEXT: f64 = 9.0;

/// A printable board.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Name of the paper.
    pub paper: &'static str,
    /// The PDF.
    pub pdf: Vec<u8>,
}

/// Draws a board on the smallest paper that holds it, upright or lying.
///
/// # Errors
/// No paper holds it.
pub fn sheet(board: &Board) -> Result<Sheet> {
    let side = |corners: usize| (corners + 1) as f64 * board.square;
    let (width, height) = (side(board.columns), side(board.rows));
    let fits =
        |(wide, high): (f64, f64)| width + 2.0 * MARGIN <= wide && height + 2.0 * MARGIN <= high;
    let sized = PAPERS.into_iter().find_map(|(paper, short, long)| {
        let sizes = [(short, long), (long, short)];
        Some((paper, sizes.into_iter().find(|&size| fits(size))?))
    });
    let Some((paper, (wide, high))) = sized else {
        return Exit::Usage.fail(format!(
            "the squares cover {width} × {height} mm, with a margin of {MARGIN} mm more than A0: take smaller or fewer squares"
        ));
    };
    let (left, bottom) = ((wide - width) / 2.0, (high - height) / 2.0);
    let mut drawing = String::from("0 g\n");
    for row in 0..=board.rows {
        for column in (row % 2..=board.columns).step_by(2) {
            let at = |start: f64, n: usize| (start + n as f64 * board.square) * POINTS;
            // Writing to a string cannot fail.
            let _ = writeln!(
                drawing,
                "{:.4} {:.4} {side:.4} {side:.4} re",
                at(left, column),
                at(bottom, row),
                side = board.square * POINTS
            );
        }
    }
    drawing.push_str("f\n");
    let inner = |corners: usize| (corners - 1) as f64 * board.square;
    let words = format!(
        "fringed calibrate --board checker:{}x{}:{}    {} x {} mm from the first to the last inner corner. Print at 100 %, then measure.",
        board.columns,
        board.rows,
        board.square,
        inner(board.columns),
        inner(board.rows)
    );
    let _ = writeln!(
        drawing,
        "BT /F1 {TEXT} Tf {:.4} {:.4} Td ({words}) Tj ET",
        8.0 * POINTS,
        (bottom / 2.0).max(6.0) * POINTS,
    );
    let page = format!(
        "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.4} {:.4}] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
        wide * POINTS,
        high * POINTS
    );
    let objects = [
        // Viewers then offer to print at actual size.
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        page,
        format!(
            "<< /Length {} >>\nstream\n{drawing}endstream",
            drawing.len()
        ),
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>".to_owned(),
    ];
    Ok(Sheet {
        paper,
        pdf: file(&objects),
    })
}

/// A PDF of these objects, the first of which is the catalogue (ISO 32000-1, 7.5).
fn file(objects: &[String]) -> Vec<u8> {
    let mut pdf = String::from("%PDF-1.6\n");
    let mut offsets = Vec::new();
    for (at, object) in objects.iter().enumerate() {
        offsets.push(pdf.len());
        let _ = write!(pdf, "{} 0 obj\n{object}\nendobj\n", at + 1);
    }
    let (table, entries) = (pdf.len(), objects.len() + 1);
    let _ = write!(pdf, "xref\n0 {entries}\n0000000000 65535 f \n");
    for offset in offsets {
        // Each entry has 20 bytes with its end of line.
        let _ = writeln!(pdf, "{offset:010} 00000 n ");
    }
    let _ = write!(
        pdf,
        "trailer\n<< /Size {entries} /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n"
    );
    pdf.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_to_scale_and_the_cross_references_point_at_their_objects() {
        let board = Board {
            columns: 9,
            rows: 13,
            square: 10.0,
        };
        let sheet = sheet(&board).unwrap();
        assert_eq!(sheet.paper, "A4");
        let text = String::from_utf8(sheet.pdf).unwrap();
        // 10 mm are 28.3465 points; 70 of 140 squares are black.
        assert_eq!(text.matches(" 28.3465 28.3465 re\n").count(), 70);
        assert!(text.contains("80 x 120 mm from the first to the last inner corner"));
        let table: usize = text
            .rsplit("startxref\n")
            .next()
            .unwrap()
            .lines()
            .next()
            .unwrap()
            .parse()
            .unwrap();
        assert!(text[table..].starts_with("xref\n0 6\n"));
        for (at, line) in text[table..].lines().skip(3).take(5).enumerate() {
            let offset: usize = line[..10].parse().unwrap();
            assert!(
                text[offset..].starts_with(&format!("{} 0 obj\n", at + 1)),
                "{line}"
            );
        }
        let (_, stream) = text.split_once("stream\n").unwrap();
        let (drawing, _) = stream.split_once("endstream").unwrap();
        assert!(text.contains(&format!("/Length {} ", drawing.len())));
    }

    #[test]
    fn a_board_takes_the_smallest_paper_and_one_beyond_a0_is_refused() {
        let board = |columns, rows, square| Board {
            columns,
            rows,
            square,
        };
        assert_eq!(sheet(&board(13, 9, 10.0)).unwrap().paper, "A4");
        assert_eq!(sheet(&board(9, 13, 20.0)).unwrap().paper, "A3");
        let error = sheet(&board(9, 13, 100.0)).unwrap_err().to_string();
        assert!(error.contains("1000 × 1400 mm"), "{error}");
    }
}
