//! A Gray code without fringes: the projector's coordinate of each pixel from the cells alone.
//!
//! A pixel's cell gives its coordinate within half a cell. At the border of two cells one bit
//! changes, and its contrast has a zero, which is found between two pixels by linear interpolation
//! (Trobina 1995 compares it with other ways). Between the two borders of a cell the coordinate is
//! interpolated linearly. Where neighbouring pixels are several cells apart there are no borders;
//! half a cell is then less than a pixel.
//!
//! A lens whose blur is wider than a cell removes the contrast of the finest bits first. The coarser
//! bits are a code of cells that are 2, 4 or 8 times as wide, and a pixel is read by as many bits as
//! it resolves.

use super::{Cells, CodeError, CodePictures};
use crate::math::around;
use crate::pipeline::{PhaseMap, for_each_row};
use crate::trust::{LeastModulation, Trust};
use crate::units::{AbsolutePhase, Modulation};
use alloc::vec;
use alloc::vec::Vec;

/// A bit whose contrast is below this share of the clearest bit's is undecided.
const UNDECIDED: f64 = 0.25;
/// Most of the finest bits that may be washed out: a blur over cells of 8 projector pixels is not
/// the lens's, but light that reaches the pixel by reflection.
const MOST_WASHED: u32 = 3;
/// Pixels along a line, to both sides, over which a bit that is washed out is undecided everywhere;
/// on the border of two cells it is undecided over fewer.
const WINDOW: usize = 6;
/// σ of a coordinate that is known within a cell, in cells: that of a uniform distribution.
pub const SIGMA_CELLS: f64 = 0.288_675_134_594_812_9;

/// The phases of a code alone.
#[derive(Clone, Debug)]
pub struct CodePhases {
    /// The phase of every pixel.
    pub map: PhaseMap,
    /// How many of the finest bits each pixel's place was found without, row-major: it is known
    /// within a cell that is twice as wide for each.
    pub missing: Vec<u8>,
}

/// What a pixel sees of a code.
#[derive(Clone, Copy, Debug, Default)]
struct CodePixel {
    /// Its bits.
    seen: u16,
    /// Those of them that are in doubt.
    undecided: u16,
    /// How many of the finest bits are in doubt.
    faint: u32,
    /// How many of them its place was read without.
    without: u32,
    /// Coordinate in cells, counted from the beginning of the first cell.
    place: f64,
    /// Half the difference of bright and dark, counts.
    modulation: f64,
    /// Whether it can be trusted, or why not.
    trust: Trust,
}

impl CodePictures<'_> {
    /// The phase of every pixel of a code of these cells, which lie along the projector's rows
    /// (`vertical` fringes) or columns. Pixels are trusted from a modulation of `least` on; samples
    /// have this full scale. A pixel is a `Residual` where two bits are undecided that are not
    /// washed out, or the cell lies outside the projector's raster, and of `LowModulation` where more
    /// bits are in doubt than a lens washes out.
    ///
    /// # Errors
    /// If the pictures do not form a code.
    pub fn phases(
        &self,
        cells: &Cells,
        vertical: bool,
        least: LeastModulation,
        full_scale: u16,
    ) -> Result<CodePhases, CodeError> {
        let count = self.bits.len();
        let (width, height) = self.size()?;
        let least = least.counts(full_scale);
        let mut pixels = vec![CodePixel::default(); width * height];
        for_each_row(&mut pixels, width, |v, row| {
            let mut contrasts = vec![0.0; count];
            for (u, pixel) in row.iter_mut().enumerate() {
                for (bit, contrast) in contrasts.iter_mut().enumerate() {
                    *contrast = self.contrast(bit, u, v);
                }
                *pixel = CodePixel::of(&contrasts, cells, least);
            }
        });
        let refined = self.refined(&pixels, cells, (width, height), vertical);
        let mut map = PhaseMap::new(width, height);
        for (at, pixel) in pixels.iter().enumerate() {
            map.trust[at] = pixel.trust;
            if pixel.trust == Trust::Resolved {
                let turns = cells.origin + refined[at].0 * cells.width;
                map.phase[at] = AbsolutePhase::from_turns(turns);
                let share = pixel.modulation / f64::from(full_scale);
                map.modulation[at] = Modulation::from_bits(libm::rint(share * 65_535.0) as u16);
            }
        }
        let missing = refined.into_iter().map(|(_, missing)| missing as u8);
        Ok(CodePhases {
            map,
            missing: missing.collect(),
        })
    }

    /// How far the sample of a bit's picture is above the middle between bright and dark, counts.
    fn contrast(&self, bit: usize, u: usize, v: usize) -> f64 {
        let against = self.against.get(bit).unwrap_or(&self.against[0]);
        let sum: f64 = against
            .iter()
            .map(|frame| f64::from(frame.row(v).at(u)))
            .sum();
        let own = f64::from(self.bits[bit].row(v).at(u));
        // An inverse picture is as far below the middle as the bit's own is above it.
        match against.len() {
            1 => (own - sum) / 2.0,
            count => own - sum / count as f64,
        }
    }

    /// The places of all pixels, interpolated between the borders of their cells where both borders
    /// are seen, and how many bits are missing where they are not.
    fn refined(
        &self,
        pixels: &[CodePixel],
        cells: &Cells,
        (width, height): (usize, usize),
        vertical: bool,
    ) -> Vec<(f64, u32)> {
        let mut places: Vec<(f64, u32)> = pixels.iter().map(|pixel| (pixel.place, 0)).collect();
        let (lines, length) = if vertical {
            (height, width)
        } else {
            (width, height)
        };
        for line in 0..lines {
            let index = |along: usize| match vertical {
                true => line * width + along,
                false => along * width + line,
            };
            let washed: Vec<u32> = (0..length)
                .map(|along| {
                    let lit = around(along, WINDOW, length)
                        .map(index)
                        .filter(|&index| pixels[index].modulation > 0.0);
                    lit.map(|index| pixels[index].faint).min().unwrap_or(0)
                })
                .collect();
            for (along, &washed) in washed.iter().enumerate() {
                places[index(along)].1 = washed.max(pixels[index(along)].without);
            }
            // The border behind, if the pixels since it are all of one cell: where it is, in pixels
            // and in cells.
            let mut behind: Option<(f64, f64)> = None;
            let mut widest = 1.0;
            for along in 0..length.saturating_sub(1) {
                let (here, next) = (&pixels[index(along)], &pixels[index(along + 1)]);
                let resolved = [here, next]
                    .iter()
                    .all(|pixel| pixel.trust == Trust::Resolved);
                let without = washed[along].max(washed[along + 1]);
                widest = f64::max(widest, f64::from(1_u32 << washed[along]));
                let pair =
                    [here, next].map(|pixel| cells.around(pixel.seen, pixel.undecided, without).0);
                if resolved && pair[0] == pair[1] {
                    continue;
                }
                let (u, v) = if vertical {
                    (along, line)
                } else {
                    (line, along)
                };
                let border = resolved
                    .then(|| self.border(cells, pair, without, (u, v), vertical))
                    .flatten();
                let border = border.map(|(share, place)| (along as f64 + share, place));
                if let (Some(from), Some(to)) = (behind, border)
                    && (1.0..=widest).contains(&libm::fabs(to.1 - from.1))
                {
                    let slope = (to.1 - from.1) / (to.0 - from.0);
                    for inside in libm::ceil(from.0) as usize..=along {
                        places[index(inside)] = (from.1 + (inside as f64 - from.0) * slope, 0);
                    }
                }
                behind = border;
                widest = 1.0;
            }
        }
        places
    }

    /// Where between a pixel and the next one along the cells the border of their cells, read
    /// without so many of the finest bits, lies, as a share of the way, and its place in cells;
    /// `None` if the two cells are not neighbours.
    fn border(
        &self,
        cells: &Cells,
        [here, next]: [u16; 2],
        without: u32,
        (u, v): (usize, usize),
        vertical: bool,
    ) -> Option<(f64, f64)> {
        if here.abs_diff(next) != 1 {
            return None;
        }
        // In plain binary several bits change in one place, the lowest always.
        let [was, is] = [here, next].map(|cell| cells.word(cell, without));
        let bit = self.bits.len() - 1 - (without + (was ^ is).trailing_zeros()) as usize;
        let (to_u, to_v) = if vertical { (u + 1, v) } else { (u, v + 1) };
        let (from, to) = (self.contrast(bit, u, v), self.contrast(bit, to_u, to_v));
        let share = from / (from - to);
        (0.0..=1.0)
            .contains(&share)
            .then(|| (share, f64::from(here.max(next) << without)))
    }
}

impl CodePixel {
    /// What a pixel sees, from the contrast of each bit of a code of these cells, the most
    /// significant bit first.
    fn of(contrasts: &[f64], cells: &Cells, least: f64) -> Self {
        let most = contrasts.iter().copied().map(libm::fabs);
        let modulation = most.fold(0.0, f64::max);
        if modulation < least {
            return Self::default();
        }
        let (mut seen, mut undecided) = (0_u16, 0_u16);
        let mut doubt = false;
        for (bit, &contrast) in contrasts.iter().rev().enumerate() {
            // In plain binary all bits below one that changes change in the same place.
            let changing = doubt && cells.coding.binary;
            let least = if changing { 2.0 * UNDECIDED } else { UNDECIDED };
            doubt = libm::fabs(contrast) < least * modulation;
            seen |= u16::from(contrast > 0.0) << bit;
            undecided |= u16::from(doubt) << bit;
        }
        let faint = undecided.trailing_ones();
        let read = (0..=faint.min(MOST_WASHED)).find_map(|without| {
            let (own, other) = cells.around(seen, undecided, without);
            // With bits in doubt the pixel lies on the border of two cells, if these are all that
            // changes there.
            let known = undecided >> without == 0 || own.abs_diff(other) == 1;
            known.then_some((without, own, other))
        });
        let Some((without, own, other)) = read else {
            let trust = match faint > MOST_WASHED {
                true => Trust::LowModulation,
                false => Trust::Residual,
            };
            return Self {
                modulation,
                faint,
                trust,
                ..Self::default()
            };
        };
        Self {
            seen,
            undecided,
            faint,
            without,
            place: f64::from(1_u32 << without) * (f64::from(own) + f64::from(other) + 1.0) / 2.0,
            modulation,
            trust: match u32::from(own << without) < cells.count {
                true => Trust::Resolved,
                false => Trust::Residual,
            },
        }
    }
}

impl Cells {
    /// The bits that a cell of the code without so many of the finest bits shows.
    fn word(&self, cell: u16, without: u32) -> u16 {
        self.coding.word(u32::from(cell), self.bits - without as u8)
    }

    /// The cell that shows these bits, and the cell in which the undecided bits are the other way
    /// round, both of the code without so many of the finest bits.
    fn around(&self, seen: u16, undecided: u16, without: u32) -> (u16, u16) {
        let [seen, undecided] = [seen, undecided].map(|word| word >> without);
        let mut own = seen;
        if self.coding.binary {
            // On the border of two cells the lowest bits are 0111 on one side and 1000 on the
            // other; the lowest bit says on which side the pixel lies.
            let low = undecided >> 1 & undecided;
            let settled = match (low ^ seen) & 1 {
                0 => low,
                _ => low ^ undecided,
            };
            own = seen & !undecided | settled;
        }
        let cell = |word| self.coding.cell(word, self.bits - without as u8);
        (cell(own), cell(own ^ undecided))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Coding;
    use super::*;
    use crate::frame::{FrameView, Samples};

    const WIDTH: usize = 90;
    const HEIGHT: usize = 7;
    const CELLS: u32 = 20;
    const CODINGS: [Coding; 3] = [
        Coding {
            binary: false,
            inverted: false,
        },
        Coding {
            binary: false,
            inverted: true,
        },
        Coding {
            binary: true,
            inverted: true,
        },
    ];

    /// The coordinate that a pixel sees, in cells: between 4 and 5 pixels a cell.
    fn seen(along: usize) -> f64 {
        let along = along as f64;
        0.4 + along / 4.6 + 0.0004 * along * along / 4.6
    }

    /// The share of light of a bit at a coordinate: a border is blurred over half a cell.
    fn light(coding: Coding, bit: u32, place: f64) -> f64 {
        let shares = (0..16).map(|part| {
            let at = place + (f64::from(part) - 7.5) / 32.0;
            let cell = libm::floor(at.clamp(0.0, 31.0)) as u32;
            f64::from(coding.word(cell, 5) >> (4 - bit) & 1)
        });
        shares.sum::<f64>() / 16.0
    }

    /// Pictures of a code of 5 bits, each with its inverse, along rows or columns.
    fn pictures(coding: Coding, vertical: bool) -> Vec<[Vec<u8>; 2]> {
        let (width, height) = size(vertical);
        let picture = |bit, inverse: bool| {
            let pixels = (0..width * height).map(|at| {
                let along = if vertical { at % width } else { at / width };
                let lit = light(coding, bit, seen(along));
                let lit = if inverse { 1.0 - lit } else { lit };
                // The last line is dark.
                let across = if vertical { at / width } else { at % width };
                let bright = if across + 1 == HEIGHT { 6.0 } else { 180.0 };
                (20.0 + bright * lit) as u8
            });
            pixels.collect()
        };
        (0..5)
            .map(|bit| [picture(bit, false), picture(bit, true)])
            .collect()
    }

    fn size(vertical: bool) -> (usize, usize) {
        if vertical {
            (WIDTH, HEIGHT)
        } else {
            (HEIGHT, WIDTH)
        }
    }

    /// Each picture beside its inverse.
    fn against_inverses(
        pictures: &[[Vec<u8>; 2]],
        (width, height): (usize, usize),
    ) -> CodePictures<'_> {
        let frame =
            |samples| FrameView::new(Samples::Eight(samples), width, height, width).unwrap();
        CodePictures {
            bits: pictures.iter().map(|[own, _]| frame(own)).collect(),
            against: pictures
                .iter()
                .map(|[_, inverse]| vec![frame(inverse)])
                .collect(),
        }
    }

    #[test]
    fn a_code_alone_gives_the_coordinate_within_a_tenth_of_a_cell_where_both_borders_are_seen() {
        let directions = CODINGS.map(|coding| [true, false].map(|vertical| (coding, vertical)));
        for (coding, vertical) in directions.into_iter().flatten() {
            let cells = Cells {
                origin: -0.25,
                width: 0.5,
                count: CELLS,
                bits: 5,
                coding,
            };
            let pictures = pictures(coding, vertical);
            let (width, height) = size(vertical);
            let map = against_inverses(&pictures, (width, height))
                .phases(&cells, vertical, LeastModulation::default(), 255)
                .unwrap()
                .map;
            let (mut refined, mut resolved) = (0, 0);
            for at in 0..width * height {
                let (along, across) = match vertical {
                    true => (at % width, at / width),
                    false => (at / width, at % width),
                };
                if across + 1 == HEIGHT {
                    assert_eq!(map.trust[at], Trust::Dark);
                    continue;
                }
                let place = seen(along);
                if place > f64::from(CELLS) + 0.5 {
                    assert_eq!(map.trust[at], Trust::Residual, "{along}");
                    continue;
                }
                if map.trust[at] == Trust::Resolved {
                    let found = (map.phase[at].turns() + 0.25) / 0.5;
                    let error = libm::fabs(found - place);
                    assert!(error < 0.51, "{along}: {found} for {place}");
                    refined += usize::from(error < 0.1);
                    resolved += 1;
                }
            }
            let lit = (HEIGHT - 1)
                * (0..WIDTH)
                    .filter(|&along| seen(along) < f64::from(CELLS))
                    .count();
            assert!(resolved >= lit * 97 / 100, "{resolved} of {lit}");
            assert!(refined >= lit * 85 / 100, "{refined} of {lit}");
        }
    }

    /// A pixel sees 1.25 cells more than the one before it, as sharp as a blur of σ = `blur` cells
    /// leaves them.
    #[test]
    fn finest_bits_that_are_washed_out_are_left_out_and_the_others_give_the_place() {
        const BITS: u8 = 9;
        for (coding, blur) in CODINGS
            .into_iter()
            .flat_map(|coding| [(coding, 1.5), (coding, 2.5)])
        {
            let cells = Cells {
                origin: 0.0,
                width: 1.0,
                count: 512,
                bits: BITS,
                coding,
            };
            let place = |u: usize| 30.3 + 1.25 * u as f64;
            let mut state = 1_u32;
            let mut noise = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 8) / f64::from(1 << 24) * 4.0 - 2.0
            };
            let mut picture = |bit: u8, inverse: bool| -> Vec<u8> {
                let sample = |u: usize| {
                    let taps = (-60..=60).map(|tap| {
                        let aside = f64::from(tap) * blur / 15.0;
                        let weight = libm::exp(-aside * aside / (2.0 * blur * blur));
                        let word = coding.word((place(u) + aside) as u32, BITS);
                        (weight, weight * f64::from(word >> (BITS - 1 - bit) & 1))
                    });
                    let sum = taps.fold((0.0, 0.0), |sum, tap| (sum.0 + tap.0, sum.1 + tap.1));
                    let lit = sum.1 / sum.0;
                    12.0 + 215.0 * if inverse { 1.0 - lit } else { lit } + noise()
                };
                let row: Vec<f64> = (0..WIDTH).map(sample).collect();
                row.into_iter().map(|light| light as u8).collect()
            };
            let pictures: Vec<[Vec<u8>; 2]> = (0..BITS)
                .map(|bit| [picture(bit, false), picture(bit, true)])
                .collect();
            let CodePhases { map, missing } = against_inverses(&pictures, (WIDTH, 1))
                .phases(&cells, true, LeastModulation::default(), 255)
                .unwrap();
            let (mut most, mut resolved) = (0.0, 0);
            for (u, missing) in missing.into_iter().enumerate() {
                let off = libm::fabs(map.phase[u].turns() - place(u));
                let within = f64::from(1_u32 << missing) / 2.0;
                assert!(
                    map.trust[u] == Trust::Resolved && off < within + 0.5,
                    "{coding:?} {blur} {u}: {off}"
                );
                if missing == 0 {
                    most = f64::max(most, off);
                    resolved += 1;
                }
            }
            // The ends of the row have a border on one side only.
            assert!(resolved >= WIDTH - 8, "{coding:?} {blur}: {resolved}");
            assert!(most < 0.4, "{coding:?} {blur}: {most}");
        }
    }

    #[test]
    fn a_pixel_on_a_border_lies_there_and_one_with_two_bits_in_doubt_nowhere() {
        let cells_of = |bits, count, binary| Cells {
            origin: 0.0,
            width: 1.0,
            count,
            bits,
            coding: Coding {
                binary,
                inverted: false,
            },
        };
        let cells = |count, binary| cells_of(3, count, binary);
        let gray = cells(8, false);
        // Cells 5 and 6 of 8 show 111 and 101.
        let border = CodePixel::of(&[100.0, 3.0, 90.0], &gray, 16.0);
        assert_eq!((border.trust, border.place), (Trust::Resolved, 6.0));
        // Without the highest bit it may be one of the cells 2 and 5.
        let far = CodePixel::of(&[3.0, 100.0, 90.0], &gray, 16.0);
        assert_eq!(far.trust, Trust::Residual);
        let two = CodePixel::of(&[100.0, 3.0, 3.0, 90.0], &cells_of(4, 16, false), 16.0);
        assert_eq!(two.trust, Trust::Residual);
        // If they are the finest, it lies in the middle of four cells.
        let four = CodePixel::of(&[100.0, 3.0, 3.0], &gray, 16.0);
        assert_eq!(
            (four.trust, four.without, four.place),
            (Trust::Resolved, 1, 6.0)
        );
        // Light that washes out five bits of ten comes by reflection.
        let mut stray = [2.0; 10];
        stray[..5].copy_from_slice(&[50.0, 30.0, 25.0, 15.0, 20.0]);
        let stray = CodePixel::of(&stray, &cells_of(10, 1024, false), 16.0);
        assert_eq!(stray.trust, Trust::LowModulation);
        assert_eq!(
            CodePixel::of(&[9.0, -9.0, 9.0], &gray, 16.0).trust,
            Trust::Dark
        );
        let beside = CodePixel::of(&[100.0, 90.0, 90.0], &cells(5, false), 16.0);
        assert_eq!(beside.trust, Trust::Residual);
        // In plain binary two bits change from cell 5 to cell 6, and the middle one never alone.
        let border = CodePixel::of(&[100.0, -3.0, 4.0], &cells(8, true), 16.0);
        assert_eq!(
            (
                border.trust,
                border.place,
                cells_of(3, 8, true)
                    .around(border.seen, border.undecided, 0)
                    .0
            ),
            (Trust::Resolved, 6.0, 5)
        );
        let middle = CodePixel::of(&[100.0, 3.0, 90.0], &cells(8, true), 16.0);
        assert_eq!(middle.trust, Trust::Residual);
    }
}
