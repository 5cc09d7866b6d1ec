//! Where a block stands on its way from the coarsest of geometric levels to the finest.

use super::quality::{Doubts, none, trust};
use crate::phase::angle::AngleLanes;
use crate::phase::fold::Folded;
use crate::phase::geometric::Geometric;
use crate::phase::level::{Level, LevelLanes, Samples};
use crate::phase::source::Frames;
use crate::phase::unwrap_step::{Ahead, Step, StepLanes, Turns};
use crate::simd::{Four, Lanes, Results};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use core::ops::Range;

/// What all blocks of a row need.
pub(super) struct Ground<V: Lanes> {
    pub angle: AngleLanes<V>,
    /// The middle of the turn that the coarsest level can have.
    middle: V::W,
    /// Whole turns that the finest level's phase counts from.
    origin: V::W,
}

impl<V: Lanes> Ground<V> {
    #[inline(always)]
    pub fn new(v: V, plan: &Geometric) -> Self {
        Self {
            angle: AngleLanes::new(v),
            middle: v.splat16(plan.middle as i16),
            origin: v.splat16((plan.origin >> 16) as i16),
        }
    }

    /// At the coarsest level, of which these are the phases.
    #[inline(always)]
    pub fn start(&self, v: V, phase: [V::W; 2], folded: &Folded<V>) -> Climb<V> {
        let zero = v.splat16(0);
        Climb {
            here: [
                Turns::within_half(v, v.sub(phase[0], self.middle)),
                Turns::within_half(v, v.sub(phase[1], self.middle)),
            ],
            doubts: Doubts {
                strong: folded.strong,
                brightest: folded.brightest,
                left: [zero; 2],
            },
        }
    }

    /// The phases of a level that only gives the order of the next.
    #[inline(always)]
    pub fn rough(&self, v: V, folded: &Folded<V>) -> [V::W; 2] {
        [
            self.angle.rough(v, folded, 0),
            self.angle.rough(v, folded, 1),
        ]
    }

    /// Stores a block: phases from their origin on and modulations of the pixels that nothing speaks against. `before` are the
    /// first doubts of the levels below.
    #[inline(always)]
    pub fn store(
        &self,
        v: V,
        climb: &Climb<V>,
        before: V::B,
        modulation: [V::W; 2],
        at: usize,
        out: &mut Results<'_>,
    ) {
        let [low, high] = climb.here;
        if climb.doubts.none(v, before) {
            // Nearly always: nothing speaks against any of them.
            let phases = [
                v.join(low.phase, v.add(low.order, self.origin)),
                v.join(high.phase, v.add(high.order, self.origin)),
            ];
            let modulation = [
                v.add(modulation[0], modulation[0]),
                v.add(modulation[1], modulation[1]),
            ];
            out.store(v, at, phases, modulation, v.splat8(Trust::Resolved as u8));
            return;
        }
        let first_doubt = v.min8(before, climb.doubts.first(v));
        let trusted = none(v, first_doubt);
        let phases = [
            self.known(v, low, trusted[0]),
            self.known(v, high, trusted[1]),
        ];
        let modulation = doubled_where(v, trusted, modulation);
        out.store(v, at, phases, modulation, trust(v, first_doubt));
    }

    /// The phase where it is trusted, [`AbsolutePhase::UNKNOWN`] elsewhere.
    #[inline(always)]
    fn known(&self, v: V, here: Turns<V>, trusted: V::W) -> [V::D; 2] {
        let unknown = v.splat16((AbsolutePhase::UNKNOWN.to_bits() >> 16) as i16);
        let order = v.pick(trusted, v.add(here.order, self.origin), unknown);
        v.join(v.and(here.phase, trusted), order)
    }
}

/// Where a block stands at a level.
#[derive(Clone, Copy)]
pub(super) struct Climb<V: Lanes> {
    pub here: [Turns<V>; 2],
    pub doubts: Doubts<V>,
}

impl<V: Lanes> Climb<V> {
    /// What it says of the next level.
    #[inline(always)]
    pub fn ahead(&self, v: V, step: &StepLanes<V>) -> Below<V> {
        Below {
            ahead: step.ahead(v, self.here),
            doubts: self.doubts,
        }
    }

    /// The same at the coarsest level.
    #[inline(always)]
    pub fn ahead_of_start(&self, v: V, step: &StepLanes<V>) -> Below<V> {
        let [low, high] = self.here;
        Below {
            ahead: step.ahead_of_start(v, [low.phase, high.phase]),
            doubts: self.doubts,
        }
    }
}

/// What a block says of the level above.
#[derive(Clone, Copy)]
pub(super) struct Below<V: Lanes> {
    pub ahead: [Ahead<V>; 2],
    pub doubts: Doubts<V>,
}

/// A level and the step that leads to it.
#[derive(Clone, Copy)]
pub(super) struct Rung<'a, V: Lanes, S> {
    level: LevelLanes<'a, V>,
    frames: S,
    pub step: StepLanes<V>,
}

impl<'a, V: Lanes, S: Frames> Rung<'a, V, S> {
    #[inline(always)]
    pub fn new(v: V, step: &Step, level: &'a Level, frames: S) -> Self {
        Self {
            level: LevelLanes::new(v, level),
            frames,
            step: StepLanes::new(v, step),
        }
    }

    /// Up to this level, roughly; `after` as in [`Frames::fold`].
    #[inline(always)]
    pub fn rough(
        &self,
        v: V,
        ground: &Ground<V>,
        below: &Below<V>,
        at: usize,
        after: usize,
    ) -> Climb<V> {
        let folded = self.frames.fold(v, &self.level, at, after);
        self.land(v, below, ground.rough(v, &folded), &folded)
    }

    /// Up to this level, and the modulation there.
    #[inline(always)]
    pub fn fine(
        &self,
        v: V,
        ground: &Ground<V>,
        below: &Below<V>,
        at: usize,
        after: usize,
    ) -> (Climb<V>, [V::W; 2]) {
        let folded = self.frames.fold(v, &self.level, at, after);
        let (block, modulation) = (self.level).fine(v, &ground.angle, &folded, S::DOUBLED);
        (self.land(v, below, block.phase, &folded), modulation)
    }

    #[inline(always)]
    fn land(&self, v: V, below: &Below<V>, phase: [V::W; 2], folded: &Folded<V>) -> Climb<V> {
        let (low, left_low) = self.step.land(v, below.ahead[0], phase[0]);
        let (high, left_high) = self.step.land(v, below.ahead[1], phase[1]);
        let before = &below.doubts;
        Climb {
            here: [low, high],
            doubts: Doubts {
                strong: v.and8(before.strong, folded.strong),
                brightest: v.max8(before.brightest, folded.brightest),
                left: [
                    v.max_unsigned(before.left[0], left_low),
                    v.max_unsigned(before.left[1], left_high),
                ],
            },
        }
    }
}

/// Four rows up to the end of the columns, of a level whose samples are subtracted in pairs.
pub(super) fn four<'a, T>(
    level: &Level,
    rows: &[&'a [T]],
    columns: &Range<usize>,
) -> Option<Four<'a, T>> {
    match (level.samples, rows) {
        (Samples::Four, &[a, b, c, d]) => Some(Four::new([a, b, c, d], columns.end)),
        _ => None,
    }
}

/// Twice the words where a mask is set, 0 elsewhere.
#[inline(always)]
pub(super) fn doubled_where<V: Lanes>(v: V, mask: [V::W; 2], x: [V::W; 2]) -> [V::W; 2] {
    [
        v.and(mask[0], v.add(x[0], x[0])),
        v.and(mask[1], v.add(x[1], x[1])),
    ]
}
