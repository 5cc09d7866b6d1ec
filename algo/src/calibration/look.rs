//! One pose of the board: whether it can be used, and if not, why.

use super::adjust::View;
use super::board::{Board, BoardError, FoundBoard};
use super::corner::Corner;
use super::nodes::Fringes;
use super::picture::Picture;
use alloc::vec::Vec;

/// Largest blur (σ of an edge) that is accepted, as a share of a square's side in the picture; real
/// boards in focus have 0.01.
const MOST_BLUR: f64 = 0.05;
/// RMS distance of a level's corners from the mean of all levels beyond which the board moved, px:
/// noise leaves 0.02.
const MOST_MOTION: f64 = 0.12;
/// Least share of the bright squares that must have a projector point.
const LEAST_COVERED: f64 = 0.9;
/// RMS distance of the corners of two pictures up to which the board lies in one place, as a share
/// of a square's side, and in px: a pose that is nearer repeats the errors of another one and not
/// only its corners, so that the residuals of both say less than they seem to. A board that is only
/// tilted by 8° moves as far.
const SAME_PLACE: (f64, f64) = (0.03, MOST_MOTION);

/// A pose that cannot be used; [`Self::remedy`] says what to do.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// The board was not found as described.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The camera's picture is blurred.
    #[error(
        "the picture is blurred: edges of the squares have a σ of {blur:.1} px, at most {most:.1} px is accepted"
    )]
    Blurred {
        /// σ of the edges, px.
        blur: f64,
        /// The limit, px.
        most: f64,
    },
    /// The board moved between frames.
    #[error("the board moved by {pixels:.2} px between the frames of different levels")]
    Moved {
        /// How far, px.
        pixels: f64,
    },
    /// The projector does not light all of the board, or its fringes cannot be decoded there.
    #[error("only {:.0} % of the board's bright squares have a phase under both patterns", share * 100.0)]
    OffFringes {
        /// Share of the bright squares that have a projector point.
        share: f64,
    },
}

impl PoseError {
    /// What to do about it.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Board(BoardError::None) => {
                "light the whole board, and show it sharp and less tilted"
            }
            Self::Board(BoardError::Size { .. }) => {
                "show the whole board, in even light without reflections, or correct --board"
            }
            Self::Board(BoardError::Few { .. }) => {
                "show the board sharp, in even light without reflections"
            }
            Self::Blurred { .. } => "focus, or bring the board nearer to where it is sharp",
            Self::Moved { .. } => "hold it still, or put it down, while frames are taken",
            Self::OffFringes { .. } => {
                "move the board into the projector's light, without shadow or reflection"
            }
        }
    }
}

/// Finds the board in the offset of each level, and its points in the projector's raster.
///
/// # Errors
/// Why the pose cannot be used.
pub fn look(board: &Board, levels: &[Picture], fringes: &Fringes<'_>) -> Result<View, PoseError> {
    let mut each = Vec::with_capacity(levels.len());
    for level in levels {
        each.push(board.find(level)?);
    }
    let found = mean(&each).ok_or(BoardError::None)?;
    board.enough(&found.corners)?;
    // Blur comes first: a board that is blurred seems to move as well.
    let (blur, most) = (found.blur(), MOST_BLUR * found.step);
    if blur > most {
        return Err(PoseError::Blurred { blur, most });
    }
    let pixels = each
        .iter()
        .map(|level| apart(level, &found))
        .fold(0.0, f64::max);
    if pixels > MOST_MOTION {
        return Err(PoseError::Moved { pixels });
    }
    let nodes = fringes.nodes(board, &found);
    let share = covered(
        board,
        &nodes.iter().map(|node| node.square).collect::<Vec<_>>(),
    );
    if share < LEAST_COVERED {
        return Err(PoseError::OffFringes { share });
    }
    Ok(View { found, nodes })
}

impl FoundBoard {
    /// Whether the board lies where it lies in another picture of the same camera, whichever way
    /// round.
    pub fn lies_as_in(&self, other: &Self) -> bool {
        let round = Self {
            corners: other.corners.iter().rev().copied().collect(),
            step: other.step,
        };
        let pixels = apart(self, other).min(apart(self, &round));
        pixels <= (SAME_PLACE.0 * self.step).max(SAME_PLACE.1)
    }
}

/// Each corner's mean over the levels that all have it.
fn mean(each: &[FoundBoard]) -> Option<FoundBoard> {
    let first = each.first()?;
    let share = 1.0 / each.len() as f64;
    let corner = |at: usize| {
        let mut sum = Corner::default();
        for level in each {
            let corner = level.corners[at]?;
            sum.u += share * corner.u;
            sum.v += share * corner.v;
            sum.blur += share * corner.blur;
        }
        Some(sum)
    };
    Some(FoundBoard {
        corners: (0..first.corners.len()).map(corner).collect(),
        step: first.step,
    })
}

/// RMS distance between the corners that were located in both pictures, px; infinite if there are
/// none.
fn apart(a: &FoundBoard, b: &FoundBoard) -> f64 {
    let pairs = a.corners.iter().zip(&b.corners);
    let (mut squares, mut n) = (0.0, 0.0);
    for (a, b) in pairs.filter_map(|(a, b)| (*a).zip(*b)) {
        squares += (a.u - b.u) * (a.u - b.u) + (a.v - b.v) * (a.v - b.v);
        n += 1.0;
    }
    if n > 0.0 {
        libm::sqrt(squares / n)
    } else {
        f64::INFINITY
    }
}

/// Share of the bright squares between inner corners that have a node. Bright are the squares of
/// the colour of which more have one.
fn covered(board: &Board, squares: &[(usize, usize)]) -> f64 {
    let (columns, rows) = (board.columns - 1, board.rows - 1);
    let share = |colour: usize| {
        let of_colour = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column, row)))
            .filter(|(column, row)| (column + row) % 2 == colour);
        let (mut have, mut all) = (0.0, 0.0);
        for square in of_colour {
            all += 1.0;
            have += f64::from(u8::from(squares.contains(&square)));
        }
        have / f64::max(all, 1.0)
    };
    share(0).max(share(1))
}
