//! A row, block by block: the levels of a block → its absolute phase, modulation and trust.

use super::about::{About, AboutLanes, MAX_ABOUT};
use super::angle::AngleLanes;
use super::decode::PhaseRow;
use super::fold::BlockSample;
use super::geometric::Geometric;
use super::level::{Level, LevelLanes, Pointer};
use super::step::{StepLanes, Turns};
use super::unwrap::too_far;
use super::wrapped::{WrappedRow, WrappedRowMut};
use crate::pattern::MAX_LEVELS;
use crate::simd::{Lanes, back_end_entry, plain};
use crate::trust::Trust;
use crate::units::AbsolutePhase;
use core::ops::Range;

/// Where a level of a row comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LevelRow<'a, T> {
    /// From its frames, in the order of their shifts.
    Frames(&'a [&'a [T]]),
    /// It has been demodulated before.
    Wrapped(WrappedRow<'a>),
}

/// The levels of a row, from coarse to fine.
pub(crate) type Levels<'a, T> = heapless::Vec<LevelRow<'a, T>, MAX_LEVELS>;

back_end_entry! {
    /// Decodes columns of a row by coarse-to-fine levels.
    fn geometric_row [T: BlockSample] = geometric_columns(
        plan: &Geometric,
        levels: &[Level],
        rows: &[LevelRow<'_, T>],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    )
}

back_end_entry! {
    /// Decodes columns of a row about a known map.
    fn about_row [T: BlockSample] = about_columns(
        plan: &About,
        levels: &[Level],
        rows: &[LevelRow<'_, T>],
        map: &[AbsolutePhase],
        columns: Range<usize>,
        out: PhaseRow<'_>,
    )
}

back_end_entry! {
    /// Demodulates columns of a row of one level; not where `before` says that all of a block is weak.
    fn wrap_row [T: BlockSample] = wrap_columns(
        level: &Level,
        row: &[&[T]],
        before: Option<WrappedRow<'_>>,
        columns: Range<usize>,
        out: WrappedRowMut<'_>,
    )
}

/// The starts of the blocks that cover columns of a row: one after the other, the last moved back so that it ends with
/// them. Columns are at least a block long.
#[inline(always)]
fn next_block<V: Lanes>(at: usize, columns: &Range<usize>) -> Option<usize> {
    if at >= columns.end {
        return None;
    }
    Some(at.min(columns.end - V::PIXELS))
}

/// The levels of a row with every constant in all lanes.
#[inline(always)]
fn in_lanes<'a, V: Lanes, T: BlockSample>(
    v: V,
    levels: &'a [Level],
    rows: &'a [LevelRow<'a, T>],
) -> heapless::Vec<LevelLanes<'a, V, T>, MAX_LEVELS> {
    let mut lanes = heapless::Vec::new();
    for (level, row) in levels.iter().zip(rows) {
        // A sequence has no more levels than fit.
        let _ = lanes.push(LevelLanes::new(v, level, *row));
    }
    lanes
}

#[inline(always)]
fn geometric_columns<V: Lanes, T: BlockSample>(
    v: V,
    plan: &Geometric,
    levels: &[Level],
    rows: &[LevelRow<'_, T>],
    columns: Range<usize>,
    out: PhaseRow<'_>,
) {
    let PhaseRow {
        phase,
        modulation,
        trust,
    } = out;
    let phases = plain::phase_bits_mut(phase);
    let modulations = plain::modulation_bits_mut(modulation);
    let levels = in_lanes(v, levels, rows);
    let mut steps: heapless::Vec<StepLanes<V>, MAX_LEVELS> = heapless::Vec::new();
    for step in &plan.steps {
        let _ = steps.push(StepLanes::new(v, step));
    }
    let (Some(coarsest), Some(finest)) = (levels.first(), levels.last()) else {
        return;
    };
    let single = levels.len() == 1;
    let between = levels.get(1..levels.len() - 1).unwrap_or(&[]);
    let angle = AngleLanes::new(v);
    let zero = v.splat16(0);
    let middle = v.splat16(plan.middle as i16);
    let origin = v.splat16((plan.origin >> 16) as i16);
    let mut climb = [[zero; 2]; MAX_LEVELS];
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let pointer = coarsest.pointer(v, at);
        let lit = pointer.strong();
        if v.none8(lit) {
            let reason = v.splat8(Trust::Dark as u8);
            store_unknown(
                v,
                reason,
                (&mut *phases, &mut *modulations, &mut *trust),
                at,
            );
            continue;
        }
        // Of a single level the coarsest is the finest.
        let mut here = match pointer {
            Pointer::Demodulated(block) => block,
            Pointer::Folded(folded) if single => finest.demodulated::<true>(v, &angle, folded),
            Pointer::Folded(folded) => coarsest.demodulated::<false>(v, &angle, folded),
        };
        climb[0] = [v.sub(here.phase[0], middle), v.sub(here.phase[1], middle)];
        let mut strong = lit;
        let mut brightest = here.brightest;
        for (level, phase) in between.iter().zip(&mut climb[1..]) {
            here = level.block::<false>(v, &angle, at);
            *phase = here.phase;
            strong = v.and8(strong, here.strong);
            brightest = v.max8(brightest, here.brightest);
        }
        if !single {
            here = finest.block::<true>(v, &angle, at);
            climb[between.len() + 1] = here.phase;
            strong = v.and8(strong, here.strong);
            brightest = v.max8(brightest, here.brightest);
        }
        let (low, left_low) = climb_half(v, &steps, &climb, 0);
        let (high, left_high) = climb_half(v, &steps, &climb, 1);
        let doubtful = v.narrow_mask([too_far(v, left_low), too_far(v, left_high)]);
        let verdict = Verdict {
            lit,
            strong,
            brightest,
            doubtful,
        };
        let reason = verdict.trust(v);
        let trusted = v.eq8(reason, v.splat8(Trust::Resolved as u8));
        let trusted = v.widen(trusted, trusted);
        let found = [
            known_phase(v, low, origin, trusted[0]),
            known_phase(v, high, origin, trusted[1]),
        ];
        v.store32(phases, at, found);
        store_modulation(v, strong, here.modulation, modulations, at);
        plain::store_trust(v, trust, at, reason);
    }
    finish(plan, &mut phases[columns]);
}

/// From the coarsest to the finest of a block's levels, half a block, and the most that a step left over.
#[inline(always)]
fn climb_half<V: Lanes>(
    v: V,
    steps: &[StepLanes<V>],
    levels: &[[V::W; 2]; MAX_LEVELS],
    half: usize,
) -> (Turns<V>, V::W) {
    let zero = v.splat16(0);
    let mut here = Turns {
        order: zero,
        phase: levels[0][half],
    };
    let mut most = zero;
    for (step, level) in steps.iter().zip(&levels[1..]) {
        let left;
        (here, left) = step.climb(v, here, level[half]);
        most = v.max_unsigned(most, left);
    }
    (here, most)
}

/// The phase from its origin on where it is trusted, [`AbsolutePhase::UNKNOWN`] elsewhere.
#[inline(always)]
fn known_phase<V: Lanes>(v: V, found: Turns<V>, origin: V::W, trusted: V::W) -> [V::D; 2] {
    // Half a turn below is the other half of the turn before.
    let order = v.add(v.add(found.order, origin), v.sar::<15>(found.phase));
    let order = v.pick(trusted, order, v.splat16(i16::MIN));
    v.join(v.and(found.phase, trusted), order)
}

/// What few sequences need: an origin between two orders (of a single level), a finest ratio that is not 1.
fn finish(plan: &Geometric, phases: &mut [i32]) {
    let part = plan.origin & 0xFFFF;
    if part == 0 && plan.scale.is_none() {
        return;
    }
    for phase in phases {
        if *phase != AbsolutePhase::UNKNOWN.to_bits() {
            let whole = i64::from(*phase) + i64::from(part);
            let scaled = plan
                .scale
                .map_or(whole, |scale| (whole * scale + (1 << 19)) >> 20);
            *phase = AbsolutePhase::saturate(scaled).to_bits();
        }
    }
}

/// What is known of the pixels of a block.
struct Verdict<B> {
    /// Mask: the coarsest level is strong.
    lit: B,
    /// Mask: every level is.
    strong: B,
    /// 255 where a sample is at full scale.
    brightest: B,
    /// Mask: a step left too much over.
    doubtful: B,
}

impl<B: Copy> Verdict<B> {
    /// The first reason of each pixel.
    #[inline(always)]
    fn trust<V: Lanes<B = B>>(&self, v: V) -> B {
        let saturated = v.eq8(self.brightest, v.splat8(u8::MAX));
        let trust = v.and8(self.doubtful, v.splat8(Trust::Residual as u8));
        let trust = v.pick8(saturated, v.splat8(Trust::Saturated as u8), trust);
        let trust = v.pick8(self.strong, trust, v.splat8(Trust::LowModulation as u8));
        v.pick8(self.lit, trust, v.splat8(Trust::Dark as u8))
    }
}

/// Where the results of a row go.
type Row<'a> = (&'a mut [i32], &'a mut [u16], &'a mut [Trust]);

/// Stores a block of which nothing is known but why.
#[inline(always)]
fn store_unknown<V: Lanes>(v: V, reason: V::B, (phases, modulations, trusts): Row<'_>, at: usize) {
    let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
    v.store32(phases, at, [[unknown; 2]; 2]);
    v.store16(modulations, at, [v.splat16(0); 2]);
    plain::store_trust(v, trusts, at, reason);
}

/// Stores the modulation of a block where every level is strong.
#[inline(always)]
fn store_modulation<V: Lanes>(
    v: V,
    strong: V::B,
    modulation: [V::W; 2],
    modulations: &mut [u16],
    at: usize,
) {
    let strong = v.widen(strong, strong);
    let known = [
        v.and(strong[0], v.add(modulation[0], modulation[0])),
        v.and(strong[1], v.add(modulation[1], modulation[1])),
    ];
    v.store16(modulations, at, known);
}

#[inline(always)]
fn about_columns<V: Lanes, T: BlockSample>(
    v: V,
    plan: &About,
    levels: &[Level],
    rows: &[LevelRow<'_, T>],
    map: &[AbsolutePhase],
    columns: Range<usize>,
    out: PhaseRow<'_>,
) {
    let PhaseRow {
        phase,
        modulation,
        trust,
    } = out;
    let phases = plain::phase_bits_mut(phase);
    let modulations = plain::modulation_bits_mut(modulation);
    let map = plain::phase_bits(map);
    let levels = in_lanes(v, levels, rows);
    let Some(first) = levels.first() else {
        return;
    };
    let about = AboutLanes::new(v, plan);
    let angle = AngleLanes::new(v);
    let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let known = v.load32(map, at);
        let unexpected = v.narrow_mask([
            v.narrow_mask32([v.eq32(known[0][0], unknown), v.eq32(known[0][1], unknown)]),
            v.narrow_mask32([v.eq32(known[1][0], unknown), v.eq32(known[1][1], unknown)]),
        ]);
        if v.all8(unexpected) {
            let reason = v.splat8(Trust::Unexpected as u8);
            store_unknown(
                v,
                reason,
                (&mut *phases, &mut *modulations, &mut *trust),
                at,
            );
            continue;
        }
        let pointer = first.pointer(v, at);
        let lit = pointer.strong();
        let looked_at = v.pick8(unexpected, v.splat8(0), lit);
        if v.none8(looked_at) {
            let dark = v.splat8(Trust::Dark as u8);
            let reason = v.pick8(unexpected, v.splat8(Trust::Unexpected as u8), dark);
            store_unknown(
                v,
                reason,
                (&mut *phases, &mut *modulations, &mut *trust),
                at,
            );
            continue;
        }
        let coarsest = match pointer {
            Pointer::Demodulated(block) => block,
            Pointer::Folded(folded) => first.demodulated::<true>(v, &angle, folded),
        };
        let mut found = [coarsest; MAX_ABOUT];
        let mut strong = looked_at;
        let mut brightest = coarsest.brightest;
        for (level, found) in levels.iter().zip(&mut found).skip(1) {
            *found = level.block::<true>(v, &angle, at);
            strong = v.and8(strong, found.strong);
            brightest = v.max8(brightest, found.brightest);
        }
        let low = about.unwrap(v, known[0], &found, 0);
        let high = about.unwrap(v, known[1], &found, 1);
        let verdict = Verdict {
            lit,
            strong,
            brightest,
            doubtful: v.narrow_mask([low.doubtful, high.doubtful]),
        };
        let reason = v.pick8(
            unexpected,
            v.splat8(Trust::Unexpected as u8),
            verdict.trust(v),
        );
        let trusted = v.eq8(reason, v.splat8(Trust::Resolved as u8));
        let trusted = v.widen(trusted, trusted);
        let (low_mask, high_mask) = (
            v.join(trusted[0], trusted[0]),
            v.join(trusted[1], trusted[1]),
        );
        let phase = [
            [
                v.pick32(low_mask[0], low.phase[0], unknown),
                v.pick32(low_mask[1], low.phase[1], unknown),
            ],
            [
                v.pick32(high_mask[0], high.phase[0], unknown),
                v.pick32(high_mask[1], high.phase[1], unknown),
            ],
        ];
        v.store32(phases, at, phase);
        store_modulation(
            v,
            strong,
            [low.modulation, high.modulation],
            modulations,
            at,
        );
        plain::store_trust(v, trust, at, reason);
    }
}

#[inline(always)]
fn wrap_columns<V: Lanes, T: BlockSample>(
    v: V,
    level: &Level,
    row: &[&[T]],
    before: Option<WrappedRow<'_>>,
    columns: Range<usize>,
    mut out: WrappedRowMut<'_>,
) {
    let level = LevelLanes::new(v, level, LevelRow::Frames(row));
    let angle = AngleLanes::new(v);
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        if let Some(before) = &before
            && v.none8(before.strong(v, at))
        {
            out.store_weak(v, at);
            continue;
        }
        let found = level.block::<true>(v, &angle, at);
        out.store(v, at, &found);
    }
}
