//! Chains on computed frames: every fringe order is right where the noise allows it, and what has
//! no chain is refused.

use super::*;
use crate::frame::{FrameView, Samples};
use crate::pattern::{PhaseRange, Sequence, Shot};
use crate::phase::{LeastModulation, Trust};
use crate::pipeline::{PhaseMap, wrapped};
use core::f64::consts::TAU;
use std::vec::Vec;

const COLUMNS: u32 = 1280;

/// Fringes of each level over the projector, and the shifts of all.
struct Levels<'a> {
    fringes: &'a [f64],
    shifts: usize,
}

/// Deterministic noise of ± 1 count.
fn jitter(seed: u64) -> f64 {
    let mixed = (seed ^ 0x9E37_79B9_7F4A_7C15).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0x94D0_49BB_1331_11EB);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
}

impl Levels<'_> {
    /// The finest number of fringes.
    fn most(&self) -> f64 {
        self.fringes.iter().copied().fold(0.0, f64::max)
    }

    fn range(&self) -> PhaseRange {
        PhaseRange {
            min: 0.0,
            max: self.most() * f64::from(COLUMNS - 1) / f64::from(COLUMNS),
        }
    }

    fn shots(&self) -> Vec<Shot> {
        let levels = self.fringes.iter();
        levels
            .flat_map(|fringes| Shot::level(fringes / self.most(), self.shifts))
            .collect()
    }

    /// A camera row that sees each projector column once, with ± `noise` counts, 8 bits.
    fn rows(&self, noise: f64) -> Vec<Vec<u8>> {
        let shots = self.shots();
        let sample = |frame: usize, column: u32| {
            let turns = self.most() * f64::from(column) / f64::from(COLUMNS);
            let sine = libm::sin(TAU * (shots[frame].ratio * turns + shots[frame].shift));
            let seed = (frame as u64) << 32 | u64::from(column);
            libm::rint(120.0 + 100.0 * sine + noise * jitter(seed)) as u8
        };
        (0..shots.len())
            .map(|frame| (0..COLUMNS).map(|column| sample(frame, column)).collect())
            .collect()
    }

    fn decode(
        &self,
        noise: f64,
        cells: Option<(Cells, &[CodeWord])>,
    ) -> Result<PhaseMap, ChainError> {
        let rows = self.rows(noise);
        let frames: Vec<_> = rows.iter().map(|row| view(row)).collect();
        let sequence = Sequence::from_frames(&self.shots()).unwrap();
        let chain = Chain::new(
            sequence.levels(),
            self.range(),
            cells.map(|(cells, _)| cells),
        )?;
        let levels = sequence.levels().iter();
        let maps: Vec<_> = levels
            .map(|level| wrapped(level, &frames, 8, LeastModulation::default()).unwrap())
            .collect();
        let chain = match cells {
            Some((cells, seen)) => {
                chain.aligned(&Edges::of(&maps[maps.len() - 1], seen, &cells, 1.0))
            }
            None => chain,
        };
        Ok(chain.unwrap(&maps, cells.map(|(_, seen)| seen)))
    }

    /// Pixels that are resolved, and those of them whose order is wrong.
    fn orders(&self, map: &PhaseMap) -> (usize, usize) {
        let (mut resolved, mut wrong) = (0, 0);
        for (column, phase) in map.phase.iter().enumerate() {
            if map.trust[column] == Trust::Resolved {
                resolved += 1;
                let truth = self.most() * column as f64 / f64::from(COLUMNS);
                let error = (phase.turns() - truth).abs();
                // σ of a phase with ± 2 counts of noise, 100 counts of modulation and 3 shifts is
                // 0.0015 turn.
                assert!(!(0.01..=0.5).contains(&error), "column {column}: {error}");
                wrong += usize::from(error > 0.5);
            }
        }
        (resolved, wrong)
    }
}

fn view(row: &[u8]) -> FrameView<'_> {
    FrameView::new(Samples::Eight(row), row.len(), 1, row.len()).unwrap()
}

fn levels<'a>(fringes: &'a [f64], shifts: usize) -> Levels<'a> {
    Levels { fringes, shifts }
}

fn gray(bits: u8, cell: f64) -> GrayCode {
    GrayCode {
        bits,
        cell,
        offset: 0.0,
        coding: Coding::default(),
    }
}

/// The cells of a code, where so many turns are so many pixels.
fn cells_of(code: &GrayCode, turns: impl Fn(f64) -> f64) -> Cells {
    Cells {
        origin: turns(-0.5 - code.offset),
        width: turns(code.cell),
        count: code.cells(COLUMNS),
        bits: code.bits,
        coding: code.coding,
    }
}

#[test]
fn two_levels_that_differ_by_a_fringe_are_unwrapped_by_their_beat() {
    // Quantisation alone: σ of a phase 4e-4 turn, of the order 90 times that.
    let two = levels(&[64.0, 63.0], 8);
    let map = two.decode(0.0, None).unwrap();
    let (resolved, wrong) = two.orders(&map);
    // The beat spans exactly one turn, so its ends may be exchanged by noise.
    assert!(resolved > 1270 && wrong <= 4, "{resolved} {wrong}");
}

#[test]
fn three_levels_are_unwrapped_by_the_beat_of_their_beats_under_noise() {
    // Beats 6 and 5, and their beat 1: steps of 6 and about 12.
    let three = levels(&[70.0, 64.0, 59.0], 4);
    let map = three.decode(2.0, None).unwrap();
    let (resolved, wrong) = three.orders(&map);
    assert!(resolved > 1270 && wrong <= 4, "{resolved} {wrong}");
}

#[test]
fn fractional_fringes_and_a_gray_code_whose_cell_is_a_fringe_are_unwrapped_by_their_beat() {
    // Periods of 66.67 and 100 pixels, cells of 100: the beat has 200.
    let code = gray(4, 100.0);
    let fractional = levels(&[19.2, 12.8], 3);
    let seen = |late: u32| -> Vec<CodeWord> {
        let sees = |column| CodeWord {
            word: code.coding.word((column + late) / 100, code.bits),
            decisive: 0,
        };
        (0..COLUMNS).map(sees).collect()
    };
    let turns = |pixels: f64| fractional.most() * pixels / f64::from(COLUMNS);
    let interval = cells_of(&code, turns);
    let map = fractional.decode(2.0, Some((interval, &seen(0)))).unwrap();
    assert_eq!(fractional.orders(&map), (1280, 0));
    // A pixel on the border of two cells may have the code of either.
    let map = fractional.decode(2.0, Some((interval, &seen(6))));
    let (resolved, wrong) = fractional.orders(&map.unwrap());
    assert!(resolved > 1270 && wrong == 0, "{resolved} {wrong}");
}

#[test]
fn a_gray_code_is_read_from_its_pictures_with_each_thing_to_compare_them_with() {
    let (white, black) = (std::vec![200; 1280], std::vec![30; 1280]);
    for (offset, binary, inverted) in [
        (0.0, false, false),
        (0.0, false, true),
        (0.0, true, false),
        (10.0, false, true),
    ] {
        let code = GrayCode {
            offset,
            coding: Coding { binary, inverted },
            ..gray(6, 20.0)
        };
        // Of 65 cells the last two look the same.
        assert_eq!(code.cells(COLUMNS), if offset > 0.0 { 63 } else { 64 });
        let picture = |bit: u8, invert: bool| -> Vec<u8> {
            let lit = |column: u32| code.lights(bit, column) != invert;
            (0..COLUMNS)
                .map(|column| if lit(column) { 200 } else { 30 })
                .collect()
        };
        let bits: Vec<_> = (0..6).map(|bit| picture(bit, false)).collect();
        let inverse: Vec<_> = (0..6).map(|bit| picture(bit, true)).collect();
        let both = std::vec![view(&white), view(&black)];
        let each = inverse.iter().map(|row| std::vec![view(row)]).collect();
        for against in [std::vec![both], each] {
            let pictures = CodePictures {
                bits: bits.iter().map(|row| view(row)).collect(),
                against,
            };
            for (column, seen) in pictures.read().unwrap().into_iter().enumerate() {
                let expected = (column + offset as usize) / 20;
                let cell = usize::from(code.coding.cell(seen.word, 6));
                assert!(cell == expected.min(63), "{column}: {cell}");
                assert_eq!(seen.decisive, 63);
            }
        }
    }
    let lonely = CodePictures {
        bits: std::vec![view(&white)],
        against: Vec::new(),
    };
    assert_eq!(lonely.read().map(|_| ()), Err(CodeError::Pictures));
}

#[test]
fn what_has_no_chain_is_refused_with_what_to_add() {
    let plan = |fringes: &[f64], cells| {
        let levels = levels(fringes, 4);
        let sequence = Sequence::from_frames(&levels.shots()).unwrap();
        Chain::new(sequence.levels(), levels.range(), cells)
    };
    assert!(matches!(plan(&[64.0], None), Err(ChainError::NoStart(_))));
    assert!(matches!(
        plan(&[64.0, 60.0], None),
        Err(ChainError::NoStart(_))
    ));
    assert!(matches!(
        plan(&[200.0, 199.0], None),
        Err(ChainError::TooFar { magnification, .. }) if magnification > 250.0
    ));
    let wide = Cells {
        origin: 0.0,
        width: 1.5,
        count: 43,
        bits: 6,
        coding: Coding::default(),
    };
    assert!(matches!(
        plan(&[64.0], Some(wide)),
        Err(ChainError::WideCells { .. })
    ));
    let chain = plan(&[64.0, 8.0, 1.0], None).unwrap();
    assert_eq!((chain.kind(), chain.steps().len()), ("geometric", 3));
    let chain = plan(&[64.0, 63.0], None).unwrap();
    assert_eq!(chain.kind(), "heterodyne");
    assert!((chain.magnification() - 89.8).abs() < 0.1);
}

/// What pixels with ± `noise` counts see of a code whose edges are blurred over three pixels.
fn blurred(code: &GrayCode, noise: f64) -> Vec<CodeWord> {
    let picture = |bit: u8| -> Vec<u8> {
        let lit = |column: u32| f64::from(u8::from(code.lights(bit, column)));
        let sample = |column: u32| {
            let near = [
                column.saturating_sub(1),
                column,
                (column + 1).min(COLUMNS - 1),
            ];
            let light: f64 = near.into_iter().map(lit).sum();
            let seed = u64::from(bit) << 40 | u64::from(column);
            libm::rint(30.0 + 60.0 * light + noise * jitter(seed)) as u8
        };
        (0..COLUMNS).map(sample).collect()
    };
    let bits: Vec<_> = (0..code.bits).map(picture).collect();
    let grey = std::vec![120; COLUMNS as usize];
    let pictures = CodePictures {
        bits: bits.iter().map(|row| view(row)).collect(),
        against: std::vec![std::vec![view(&grey)]],
    };
    pictures.read().unwrap()
}

#[test]
fn a_cell_as_wide_as_a_fringe_loses_only_pixels_whose_bit_is_not_decisive() {
    let single = levels(&[32.0], 4);
    let turns = |pixels: f64| 32.0 * pixels / f64::from(COLUMNS);
    // The code as described, and some pixels off: where the fringes say that its edges are.
    for late in [0.0, 2.0, 4.0] {
        let code = GrayCode {
            offset: late,
            ..gray(6, 40.0)
        };
        let seen = blurred(&code, 20.0);
        let stated = cells_of(&gray(6, 40.0), turns);
        let map = single.decode(2.0, Some((stated, &seen))).unwrap();
        let (resolved, wrong) = single.orders(&map);
        assert!(
            resolved > 1280 * 92 / 100 && wrong == 0,
            "{late}: {resolved} {wrong}"
        );
    }
}

#[test]
fn the_edges_of_cells_tell_their_offset_and_width_within_the_fringes() {
    let single = levels(&[32.0], 4);
    let turns = |pixels: f64| 32.0 * pixels / f64::from(COLUMNS);
    let rows = single.rows(2.0);
    let frames: Vec<_> = rows.iter().map(|row| view(row)).collect();
    let sequence = Sequence::from_frames(&single.shots()).unwrap();
    let level = &sequence.levels()[0];
    let map = wrapped(level, &frames, 8, LeastModulation::default()).unwrap();
    for (cell, offset) in [
        (20.0, 0.0),
        (40.0, 0.0),
        (40.0, 20.0),
        (41.0, 0.0),
        (30.0, 10.0),
    ] {
        let code = GrayCode {
            offset,
            ..gray(7, cell)
        };
        let stated = gray(7, 40.0);
        let seen = blurred(&code, 2.0);
        let edges = Edges::of(&map, &seen, &cells_of(&stated, turns), 1.0);
        assert!(edges.are_many() && edges.smoothness() > 0.99);
        let fitted = edges.fitted();
        assert!((fitted - turns(cell)).abs() < 1e-3, "{cell}: {fitted}");
        assert!(edges.agree(fitted));
        let (origin, _) = edges.origin(fitted);
        let off = origin - turns(-0.5 - offset);
        let off = off - libm::rint(off);
        assert!(off.abs() < 0.02, "{cell} {offset}: {off}");
        let near = edges.misalignment(&cells_of(&code, turns), 1.0).unwrap();
        assert!(near.abs() < 0.02, "{near}");
        let far = edges.misalignment(&cells_of(&stated, turns), 1.0);
        assert_eq!(far.is_some(), (cell, offset) == (40.0, 0.0));
    }
}
