//! What the projector shows for a live picture: uniform light, fringes, and charts to aim and focus
//! with.

use crate::head::calibration::Calibration;
use crate::head::rasters::fringes;
use hal::error::Error;
use hal::projector::Raster;

/// Shifts of the fringes, a quarter of a turn each; each picture shows the next one.
pub const SHIFTS: usize = 4;
/// Side of a square of the focus chart's finest and coarsest field, projector pixels.
const FINEST: u32 = 1;
const COARSEST: u32 = 8;
/// Width of the lines of cross and frame, projector pixels.
const LINE: u32 = 3;

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// Full light.
    White,
    /// No light.
    Black,
    /// Checkerboards of squares of 1, 2, 4 and 8 projector pixels.
    Focus,
    /// A cross in the projector's centre.
    Cross,
    /// The projector's edges, its inner 80 % and its diagonals.
    Volume,
    /// Vertical fringes of 8 projector pixels.
    Fringes8,
    /// Vertical fringes of 12 projector pixels.
    Fringes12,
}

impl Show {
    /// All of them, in the order of [`rasters()`].
    pub const ALL: [Self; 7] = [
        Self::White,
        Self::Black,
        Self::Focus,
        Self::Cross,
        Self::Volume,
        Self::Fringes8,
        Self::Fringes12,
    ];

    /// The word for the pattern.
    pub fn word(self) -> &'static str {
        match self {
            Self::White => "white",
            Self::Black => "black",
            Self::Focus => "focus",
            Self::Cross => "cross",
            Self::Volume => "volume",
            Self::Fringes8 => "fringes8",
            Self::Fringes12 => "fringes12",
        }
    }

    /// The pattern that a word stands for.
    pub fn parse(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|show| show.word() == word)
    }

    /// The pitch of fringes, projector pixels.
    pub fn pitch(self) -> Option<u32> {
        match self {
            Self::Fringes8 => Some(8),
            Self::Fringes12 => Some(12),
            _ => None,
        }
    }

    /// The place of its raster, or of that of one shift of its fringes, among [`rasters()`].
    pub fn at(self, shift: usize) -> usize {
        let first = Self::ALL.into_iter().take_while(|other| *other != self);
        let before: usize = first
            .map(|other| if other.pitch().is_some() { SHIFTS } else { 1 })
            .sum();
        match self.pitch() {
            Some(_) => before + shift % SHIFTS,
            None => before,
        }
    }
}

/// The rasters of everything that can be shown.
///
/// # Errors
/// `Unsupported` if the projector is too small for fringes.
pub fn rasters(calibration: &Calibration) -> Result<Vec<Raster>, Error> {
    let (columns, rows) = calibration.raster();
    let mut all = Vec::new();
    for show in Show::ALL {
        match show.pitch() {
            Some(pitch) => all.extend(fringes((columns, rows), pitch, SHIFTS, calibration)?),
            None => {
                let grey = |at: u32| grey(show, (at % columns, at / columns), (columns, rows));
                let pixels = (0..columns * rows).map(|at| if grey(at) { u8::MAX } else { 0 });
                all.push(Raster::new(columns, rows, pixels.collect())?);
            }
        }
    }
    Ok(all)
}

/// Whether a pixel of a chart is white.
fn grey(show: Show, (x, y): (u32, u32), (columns, rows): (u32, u32)) -> bool {
    match show {
        Show::White => true,
        Show::Focus => {
            // Four columns of fields, from fine to coarse and back in the next row, so that each is
            // seen in every corner.
            let (field, row) = (4 * x / columns.max(1), 4 * y / rows.max(1));
            let side = (FINEST << ((field + row) % 4)).min(COARSEST);
            (x / side + y / side).is_multiple_of(2)
        }
        Show::Cross => {
            let near = |at: u32, size: u32| at.abs_diff(size / 2) < LINE;
            near(x, columns) || near(y, rows)
        }
        Show::Volume => {
            let edge = |at: u32, from: u32, size: u32| {
                at >= from && at < size - from && (at < from + LINE || at >= size - from - LINE)
            };
            let within = |at: u32, from: u32, size: u32| at >= from && at < size - from;
            let frame = |inset: u32| {
                let (dx, dy) = (columns * inset / 100, rows * inset / 100);
                edge(x, dx, columns) && within(y, dy, rows)
                    || edge(y, dy, rows) && within(x, dx, columns)
            };
            let down = u64::from(x) * u64::from(rows) / u64::from(columns.max(1));
            let diagonal = |at: u64| u64::from(y).abs_diff(at) < u64::from(LINE) / 2 + 1;
            frame(0)
                || frame(10)
                || diagonal(down)
                || diagonal(u64::from(rows - 1) - down.min(u64::from(rows - 1)))
        }
        Show::Black | Show::Fringes8 | Show::Fringes12 => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_show_has_a_raster_of_its_own_and_each_shift_another() {
        let mut places: Vec<usize> = Vec::new();
        for show in Show::ALL {
            let shifts = if show.pitch().is_some() { SHIFTS } else { 1 };
            places.extend((0..shifts).map(|shift| show.at(shift)));
            assert_eq!(Show::parse(show.word()), Some(show));
        }
        assert_eq!(places, (0..13).collect::<Vec<_>>());
        assert_eq!(Show::parse("red"), None);
    }

    #[test]
    fn the_charts_stay_within_the_raster_and_are_neither_all_white_nor_all_black() {
        let size = (64, 48);
        for show in [Show::Focus, Show::Cross, Show::Volume] {
            let lit = (0..64 * 48)
                .filter(|at| grey(show, (at % 64, at / 64), size))
                .count();
            assert!(lit > 100 && lit < 64 * 48 - 100, "{show:?}: {lit}");
        }
        assert!(grey(Show::Volume, (0, 0), size) && grey(Show::Cross, (32, 1), size));
    }
}
