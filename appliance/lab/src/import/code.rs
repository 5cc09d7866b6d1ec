//! What looks wrong with a Gray code: beside fringes its cells end within them where the options say,
//! and alone it numbers the picture from one side to the other; else an option is named with which
//! it does.

use super::direction::rising_and_falling;
use crate::Failed;
use crate::description::{BitOrder, Description, Direction, Gray};
use crate::lists::{Series, of_direction};
use crate::shifts::usual;
use algo::chain::{Cells, CodeWord, Coding, EXPECTED_TURNS, Edges};
use algo::phase::Trust;
use algo::pipeline::PhaseMap;
use appliance::head::channel::Channel;
use appliance::head::code::CodeAlone;
use appliance::measure::least_modulation;
use hal::replay::Recording;
use hal::replay::recording::PatternSpec;

/// Largest smoothness (`Edges::smoothness`) of the cells by a wrong coding.
const DOUBTFUL: f64 = 0.9;
/// By how much more smoothness another coding must have.
const BETTER: f64 = 0.2;
/// Least smoothness of a coding that is named.
const MEANT: f64 = 0.6;
/// How far cells of another width must be off at one end of what is seen, turns.
const APART: f64 = 0.15;
/// How near a number must be to a whole number to stand for it, as a share of that.
const WHOLE: f64 = 0.004;
/// How near an offset must be to a whole number of quarters of a cell to stand for it, cells.
const NEAR_QUARTER: f64 = 0.0625;
/// Share of a cell by which a code may begin before the raster, so that it is not a matter of the
/// shifts.
const WITHIN_CELL: std::ops::Range<f64> = 0.1..0.9;
/// Share of the pixels that a code alone must light.
const LIT: f64 = 0.01;
/// Share of its lit pixels that may be in doubt.
const DOUBT: f64 = 0.4;
/// Pixels that are compared lie this part of the frame apart: a sixteenth.
const FRAME_PARTS: usize = 16;
/// Least excess of pairs whose cells rise over those whose cells fall, or the other way round, as a
/// share of both: a code that is read in another order or form has at most 0.4, a right one nearly
/// 1, but for the edges of parts.
const ONE_WAY: f64 = 0.7;
/// The remedy where no other reading of the pictures fits.
const REMEDY: &str = "check the order of the pictures, --gray, --gray-cell, --gray-order, --gray-binary, --gray-invert and --order";

/// What is wrong with the code beside the finest level of a pattern, in words with remedies; `None`
/// where there is too little to tell.
///
/// # Errors
/// In words: the pictures do not form a code.
pub(super) fn notes_beside(
    recording: &Recording,
    (pattern, channel): (usize, &Channel<'_>),
    finest: &PhaseMap,
    description: &Description,
) -> Result<Option<Vec<String>>, Failed> {
    let code = recording.codes.iter().find(|code| code.pattern == pattern);
    let (Some(code), Some(cells), Some(seen)) = (code, channel.cells(), channel.seen()?) else {
        return Ok(None);
    };
    let ratio = channel.finest();
    let mut notes = Vec::new();
    let mut edges = Edges::of(finest, &seen, &cells, ratio);
    if edges.smoothness() < DOUBTFUL
        && let Some(better) = coding(finest, &seen, cells, ratio, &edges)
    {
        let options = options(better.reversed, better.coding, &description.gray);
        notes.push(format!(
            "cells of the Gray code that are neighbours follow each other in {:.0} %, with {} in {:.0} %: give {}",
            100.0 * edges.smoothness(),
            options,
            100.0 * better.edges.smoothness(),
            options
        ));
        edges = better.edges;
    }
    if !edges.are_many() {
        return Ok(None);
    }
    let projector = &recording.projector;
    let vertical = !matches!(recording.patterns[pattern], PatternSpec::Horizontal { .. });
    let beside = Beside {
        edges: &edges,
        origin: cells.origin * ratio,
        turns: cells.width * ratio,
        binary: cells.coding.binary,
        cell_px: code.cell_px,
        length: f64::from(match vertical {
            true => projector.width,
            false => projector.height,
        }),
        description,
        vertical,
    };
    notes.extend(beside.width());
    notes.extend(beside.offset());
    Ok(Some(notes))
}

/// Another way to read a code's pictures.
struct Reading {
    edges: Edges,
    reversed: bool,
    coding: Coding,
}

/// The other ways to read the pictures of a code: whether the order of its bits is reversed, and
/// its coding. One change, then two, then all three.
fn otherwise(stated: Coding) -> impl Iterator<Item = (bool, Coding)> {
    [1_u8, 2, 4, 3, 5, 6, 7].into_iter().map(move |changes| {
        let coding = Coding {
            binary: stated.binary != (changes & 2 != 0),
            inverted: stated.inverted != (changes & 4 != 0),
        };
        (changes & 1 != 0, coding)
    })
}

/// The options of the command line that state this order and coding.
fn options(reversed: bool, coding: Coding, gray: &Gray) -> String {
    let mut options = Vec::new();
    if reversed {
        options.push(match gray.order {
            BitOrder::Msb => "--gray-order lsb",
            BitOrder::Lsb => "--gray-order msb",
        });
    }
    if coding.binary != gray.coding().binary {
        options.push(match coding.binary {
            true => "--gray-binary",
            false => "no --gray-binary",
        });
    }
    if coding.inverted != gray.coding().inverted {
        options.push(match coding.inverted {
            true => "--gray-invert",
            false => "no --gray-invert",
        });
    }
    options.join(" ")
}

/// The reading with the fewest changes that brings clearly more cells together than the stated one,
/// if there is one.
fn coding(
    finest: &PhaseMap,
    seen: &[CodeWord],
    cells: Cells,
    ratio: f64,
    stated: &Edges,
) -> Option<Reading> {
    let unused = u16::BITS - u32::from(cells.bits);
    let back = |word: u16| word.reverse_bits() >> unused;
    let backwards: Vec<CodeWord> = seen
        .iter()
        .map(|seen| CodeWord {
            word: back(seen.word),
            decisive: back(seen.decisive),
        })
        .collect();
    let mut best: Option<Reading> = None;
    for (reversed, coding) in otherwise(cells.coding) {
        let read = if reversed { &backwards[..] } else { seen };
        let edges = Edges::of(finest, read, &Cells { coding, ..cells }, ratio);
        let known = best.as_ref().map_or(stated, |best| &best.edges);
        if edges.smoothness() > known.smoothness() + BETTER && edges.smoothness() > MEANT {
            best = Some(Reading {
                edges,
                reversed,
                coding,
            });
        }
    }
    best
}

/// A code beside the fringes of a pattern, and where its cells end within them.
struct Beside<'a> {
    edges: &'a Edges,
    /// Phase of the finest level at the beginning of the first cell, and width of a cell in its
    /// turns, as stated.
    origin: f64,
    turns: f64,
    binary: bool,
    cell_px: f64,
    /// Projector pixels across the fringes.
    length: f64,
    description: &'a Description,
    /// Whether it numbers columns.
    vertical: bool,
}

impl Beside<'_> {
    /// Projector pixels per fringe of the finest level.
    fn pitch(&self) -> f64 {
        self.cell_px / self.turns
    }

    /// Whether the phase falls where the code rises.
    fn falls(&self) -> bool {
        self.edges.turns_per_cell() < 0.0
    }

    /// The width of cells in turns that their edges have, which is negative where the phase falls.
    fn fitted(&self) -> f64 {
        let sign = if self.falls() { -1.0 } else { 1.0 };
        let (stated, fitted) = (sign * self.turns, self.edges.fitted());
        let apart = (fitted - stated).abs() * self.edges.span() > APART;
        match apart && self.edges.agree(fitted) {
            true => fitted,
            false => stated,
        }
    }

    /// Whether the cells have another width than stated, or none.
    fn width(&self) -> Option<String> {
        let (stated, fitted) = (self.turns, self.fitted().abs());
        if fitted == stated {
            return (!self.edges.agree(self.fitted())).then(|| {
                "the cells of the Gray code end anywhere within the fringes: check --fringes, --gray-cell and the order of the \
                 pictures"
                    .into()
            });
        }
        let cell = fitted * self.pitch();
        let fringes = self.length / self.pitch() * fitted / stated;
        let rounded = |value: f64, per: f64| {
            let whole = (value * per).round() / per;
            let is_whole = (value - whole).abs() <= WHOLE * value;
            (
                is_whole,
                if is_whole {
                    whole
                } else {
                    (value * 100.0).round() / 100.0
                },
            )
        };
        let ((whole_cell, cell), (whole_fringes, fringes)) =
            (rounded(cell, 2.0), rounded(fringes, 1.0));
        let by_cell = format!(
            "--gray-cell {}",
            self.of_both(&self.description.gray.cell_px, cell)
        );
        let by_fringes = format!("--fringes {fringes} for the finest level");
        // Cells of this width would lie beside the raster.
        let beside = self.edges.last() * cell > self.length + cell;
        let options = match (beside, whole_cell, whole_fringes) {
            (true, _, _) => by_fringes,
            (false, true, true) => format!("{by_cell}, or {by_fringes}"),
            (false, _, _) => by_cell,
        };
        Some(format!(
            "a cell of the Gray code is {fitted:.3} fringes wide, by the options {stated:.3}: give {options}"
        ))
    }

    /// Whether cells and fringes begin elsewhere than stated.
    fn offset(&self) -> Option<String> {
        let turns = self.fitted();
        if !self.edges.agree(turns) {
            return None;
        }
        let (origin, _) = self.edges.origin(turns);
        let expected = self.origin;
        let stated = self.description.shifts;
        if self.falls() {
            // φ = ½ − Φ − both shifts.
            let total = 0.5 - stated.total() - origin - expected;
            let options = stated.with_total(stated.sign.reversed(), total);
            let other = match self.binary {
                true => ", or --gray-invert",
                false => "",
            };
            return Some(format!(
                "the phase falls where the Gray code rises: give {}{other}",
                options.options(stated)
            ));
        }
        let off = origin - expected;
        let off = off - off.round();
        if off.abs() <= EXPECTED_TURNS {
            return None;
        }
        let by_shifts = stated.with_total(stated.sign, stated.total() + off);
        let by_shifts = by_shifts.options(stated);
        let options = match (usual(off), self.by_offset(off, turns)) {
            (Some(_), Some(by_offset)) => format!("{by_shifts}, or {by_offset}"),
            (None, Some(by_offset)) => by_offset,
            (_, None) => by_shifts,
        };
        Some(format!(
            "the cells of the Gray code end {:.2} fringes from where the fringes begin: give {options}",
            off.abs()
        ))
    }

    /// The offset with which cells and fringes begin together, if it is not one of whole cells.
    fn by_offset(&self, off: f64, turns: f64) -> Option<String> {
        let cell = turns * self.pitch();
        let stated = of_direction(&self.description.gray.offset_px, self.vertical).unwrap_or(0.0);
        let offset = (stated - off * self.pitch()).rem_euclid(cell);
        let share = offset / cell;
        let quarters = (4.0 * share).round() / 4.0;
        let offset = match (quarters - share).abs() < NEAR_QUARTER {
            true => quarters * cell,
            false => (offset * 2.0).round() / 2.0,
        };
        WITHIN_CELL.contains(&share).then(|| {
            format!(
                "--gray-offset {} if the code and not the fringes begin elsewhere",
                self.of_both(&self.description.gray.offset_px, offset)
            )
        })
    }

    /// A number for this code, beside that of the other one if there is another: that of the
    /// columns first.
    fn of_both(&self, stated: &Option<Series<f64>>, own: f64) -> String {
        let both = matches!(
            self.description.direction,
            Direction::Both | Direction::HorizontalFirst
        );
        match of_direction(stated, !self.vertical).filter(|_| both) {
            Some(other) if self.vertical => format!("{own},{other}"),
            Some(other) => format!("{other},{own}"),
            None => own.to_string(),
        }
    }
}

/// What looks wrong with codes without fringes, in words with remedies: the options of another
/// reading of the pictures, if one fits.
///
/// # Errors
/// In words: the pictures form no code.
pub(super) fn notes_alone(
    recording: &Recording,
    description: &Description,
) -> Result<Vec<String>, Failed> {
    let mut notes = Vec::new();
    let least = least_modulation(recording);
    for pattern in 0..recording.patterns.len() {
        let Some(code) = CodeAlone::of(recording, pattern)? else {
            continue;
        };
        let Some(words) = problem(&code.phases(least)?) else {
            continue;
        };
        let number = if code.vertical { "columns" } else { "rows" };
        let fits = otherwise(code.cells.coding).find(|&(reversed, coding)| {
            let read = code.read_as(reversed, coding).phases(least);
            read.is_ok_and(|map| problem(&map).is_none())
        });
        let remedy = match fits {
            Some((reversed, coding)) => {
                format!("give {}", options(reversed, coding, &description.gray))
            }
            None => REMEDY.to_owned(),
        };
        notes.push(format!("Gray code of {number}: {words}{remedy}"));
    }
    Ok(notes)
}

/// What is wrong with the phases of a code, up to the remedy.
fn problem(map: &PhaseMap) -> Option<String> {
    let pixels = map.trust.len() as f64;
    let (resolved, doubt) = (map.count(Trust::Resolved), map.count(Trust::Residual));
    let lit = (resolved + doubt) as f64;
    if lit < LIT * pixels {
        return Some(format!(
            "only {:.1} % of the pixels are lit: if the pictures are only dim, give the camera's noise with --noise; else ",
            100.0 * lit / pixels
        ));
    }
    if doubt as f64 > DOUBT * lit {
        return Some(format!(
            "{:.0} % of the lit pixels have two bits in doubt, or a cell beyond the projector's edge: ",
            100.0 * doubt as f64 / lit
        ));
    }
    let [right, down] = one_way(map);
    (right.max(down) < ONE_WAY).then(|| {
        "the cells rise and fall by turns along the rows and the columns of the picture: ".into()
    })
}

/// The excess of pairs whose phase changes in one way, along rows and along columns.
fn one_way(map: &PhaseMap) -> [f64; 2] {
    let width = map.width.max(1);
    [(true, width), (false, map.phase.len() / width)].map(|(along_rows, length)| {
        let apart = (length / FRAME_PARTS).max(1);
        let [rising, falling] = rising_and_falling(map, along_rows, apart);
        rising.abs_diff(falling) as f64 / (rising + falling).max(1) as f64
    })
}
