//! What the levels of a measurement say that were decoded when they arrived, while the next was being exposed.
//!
//! Geometric levels climb: of each pixel only what the finest level so far says of the next is kept, in place. Levels about a known map
//! need one another at the end: wrapped phase and doubts of each are kept.

use super::level::Demodulated;
use crate::pattern::MAX_LEVELS;
use crate::simd::Lanes;
use alloc::vec;
use alloc::vec::Vec;

/// The levels that have arrived, coarse to fine, of a whole frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrived {
    /// Pixels per row.
    width: usize,
    /// Rows.
    height: usize,
    /// How many levels.
    levels: usize,
    planes: Planes,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Planes {
    Climbed(Climbed),
    Wrapped(Vec<Wrapped>),
}

/// What the finest level so far says of the next, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Climbed {
    /// Of the phase expected at the next level, 1/65536 turn.
    pub fraction: Vec<u16>,
    /// The same in turns, in the fixed point of the step to it.
    pub turns: Vec<u16>,
    /// The number of the first [`crate::trust::Trust`] that speaks against it, or [`NO_DOUBT`].
    pub doubt: Vec<u8>,
}

/// Nothing speaks against a pixel so far. Above every reason, so that of two the smaller is the first.
pub(super) const NO_DOUBT: u8 = u8::MAX;

/// One demodulated level, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Wrapped {
    /// φ in 1/65536 turn.
    pub phase: Vec<u16>,
    /// [`WEAK`] and [`SATURATED`].
    pub doubts: Vec<u8>,
}

/// The modulation is below the trusted minimum.
const WEAK: u8 = 1;
/// A sample is at full scale, where that matters.
const SATURATED: u8 = 2;

impl Arrived {
    pub(super) fn climbing(width: usize, height: usize) -> Self {
        let pixels = width * height;
        let planes = Planes::Climbed(Climbed {
            fraction: vec![0; pixels],
            turns: vec![0; pixels],
            doubt: vec![NO_DOUBT; pixels],
        });
        Self {
            width,
            height,
            levels: 0,
            planes,
        }
    }

    /// With room for this many levels.
    pub(super) fn wrapping(width: usize, height: usize, levels: usize) -> Self {
        let pixels = width * height;
        let level = Wrapped {
            phase: vec![0; pixels],
            doubts: vec![0; pixels],
        };
        Self {
            width,
            height,
            levels: 0,
            planes: Planes::Wrapped(vec![level; levels]),
        }
    }

    /// How many levels have arrived.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// Width and height of the frames.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Forgets all levels: those of another measurement may arrive.
    pub fn restart(&mut self) {
        self.levels = 0;
    }

    /// One more has been written.
    pub(crate) fn add_level(&mut self) {
        self.levels += 1;
    }

    /// Row `v` of geometric levels.
    pub(super) fn climbed_row(&self, v: usize) -> Option<ClimbedRow<'_>> {
        let Planes::Climbed(planes) = &self.planes else {
            return None;
        };
        let row = v * self.width..(v + 1) * self.width;
        Some(ClimbedRow {
            fraction: &planes.fraction[row.clone()],
            turns: &planes.turns[row.clone()],
            doubt: &planes.doubt[row],
        })
    }

    /// Row `v` of each level about a known map, coarse to fine.
    pub(super) fn wrapped_rows(&self, v: usize) -> heapless::Vec<WrappedRow<'_>, MAX_LEVELS> {
        match &self.planes {
            Planes::Climbed(_) => heapless::Vec::new(),
            Planes::Wrapped(levels) => levels
                .iter()
                .map(|level| level.row(self.width, v))
                .collect(),
        }
    }

    /// Where the next level is to be written to: what it is, and its maps; empty if there is no room for another.
    pub(crate) fn arriving(&mut self) -> (ArrivingLevel<'_>, PlanesMut<'_>) {
        match &mut self.planes {
            Planes::Climbed(planes) => (
                ArrivingLevel::Climbing,
                (&mut planes.fraction, &mut planes.turns, &mut planes.doubt),
            ),
            Planes::Wrapped(levels) => {
                let there = self.levels.min(levels.len());
                let (before, rest) = levels.split_at_mut(there);
                let level = ArrivingLevel::Wrapping {
                    coarsest: before.first(),
                    width: self.width,
                };
                let planes: PlanesMut<'_> = match rest.first_mut() {
                    Some(next) => (&mut next.phase, &mut [], &mut next.doubts),
                    None => (&mut [], &mut [], &mut []),
                };
                (level, planes)
            }
        }
    }

    /// Every row, for the next level to be written to.
    #[cfg(test)]
    pub(crate) fn rows(&mut self) -> impl Iterator<Item = ArrivingRow<'_>> {
        let width = self.width.max(1);
        let (level, (first, second, third)) = self.arriving();
        let mut seconds = second.chunks_mut(width);
        let rows = first.chunks_mut(width).zip(third.chunks_mut(width));
        rows.enumerate().map(move |(v, (first, third))| {
            level.row(v, (first, seconds.next().unwrap_or_default(), third))
        })
    }
}

impl Wrapped {
    fn row(&self, width: usize, v: usize) -> WrappedRow<'_> {
        let row = v * width..(v + 1) * width;
        WrappedRow {
            phase: &self.phase[row.clone()],
            doubts: &self.doubts[row],
        }
    }
}

/// Three maps, or a row of each: fraction, turns, doubt, or phase, nothing, doubts.
pub(crate) type PlanesMut<'a> = (&'a mut [u16], &'a mut [u16], &'a mut [u8]);

/// The level that is to be written next.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ArrivingLevel<'a> {
    /// A geometric one.
    Climbing,
    /// One about a known map.
    Wrapping {
        /// The first of them, if it is there already.
        coarsest: Option<&'a Wrapped>,
        width: usize,
    },
}

impl<'a> ArrivingLevel<'a> {
    /// Row `v` of its maps.
    pub fn row<'b>(&self, v: usize, (first, second, third): PlanesMut<'b>) -> ArrivingRow<'b>
    where
        'a: 'b,
    {
        match *self {
            Self::Climbing => ArrivingRow::Climbing(ClimbedRowMut {
                fraction: first,
                turns: second,
                doubt: third,
            }),
            Self::Wrapping { coarsest, width } => ArrivingRow::Wrapping {
                coarsest: coarsest.map(|level| level.row(width, v)),
                row: WrappedRowMut {
                    phase: first,
                    doubts: third,
                },
            },
        }
    }
}

/// A row of what has arrived, for the next level to be written to.
#[derive(Debug)]
pub(crate) enum ArrivingRow<'a> {
    /// Of geometric levels.
    Climbing(ClimbedRowMut<'a>),
    /// Of levels about a known map.
    Wrapping {
        /// The first of them, if it is there already.
        coarsest: Option<WrappedRow<'a>>,
        row: WrappedRowMut<'a>,
    },
}

/// A row of [`Climbed`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClimbedRow<'a> {
    pub fraction: &'a [u16],
    pub turns: &'a [u16],
    pub doubt: &'a [u8],
}

/// A row of [`Climbed`], to be written.
#[derive(Debug)]
pub(crate) struct ClimbedRowMut<'a> {
    pub fraction: &'a mut [u16],
    pub turns: &'a mut [u16],
    pub doubt: &'a mut [u8],
}

impl ClimbedRowMut<'_> {
    pub fn as_row(&self) -> ClimbedRow<'_> {
        ClimbedRow {
            fraction: self.fraction,
            turns: self.turns,
            doubt: self.doubt,
        }
    }
}

/// A row of a demodulated level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrappedRow<'a> {
    pub phase: &'a [u16],
    pub doubts: &'a [u8],
}

/// A row of a demodulated level, to be written.
#[derive(Debug)]
pub(crate) struct WrappedRowMut<'a> {
    pub phase: &'a mut [u16],
    pub doubts: &'a mut [u8],
}

impl WrappedRow<'_> {
    /// Mask: the block's pixels that are not weak.
    #[inline(always)]
    pub fn strong<V: Lanes>(&self, v: V, at: usize) -> V::B {
        let weak = v.splat8(WEAK);
        v.eq8(v.and8(v.load8(self.doubts, at), weak), v.splat8(0))
    }

    #[inline(always)]
    pub fn block<V: Lanes>(&self, v: V, at: usize) -> Demodulated<V> {
        let saturated = v.splat8(SATURATED);
        let doubts = v.load8(self.doubts, at);
        Demodulated {
            phase: v.load16(self.phase, at),
            strong: self.strong(v, at),
            brightest: v.eq8(v.and8(doubts, saturated), saturated),
        }
    }
}

impl WrappedRowMut<'_> {
    #[inline(always)]
    pub fn store<V: Lanes>(&mut self, v: V, at: usize, block: &Demodulated<V>) {
        v.store16(self.phase, at, block.phase);
        let weak = v.pick8(block.strong, v.splat8(0), v.splat8(WEAK));
        let saturated = v.eq8(block.brightest, v.splat8(u8::MAX));
        let doubts = v.or8(weak, v.and8(saturated, v.splat8(SATURATED)));
        v.store8(self.doubts, at, doubts);
    }

    /// A block of which nothing is known but that it is weak.
    #[inline(always)]
    pub fn store_weak<V: Lanes>(&mut self, v: V, at: usize) {
        v.store16(self.phase, at, [v.splat16(0); 2]);
        v.store8(self.doubts, at, v.splat8(WEAK));
    }
}
