//! A row, block by block: the levels of a block → its absolute phase, modulation and trust.

use super::about::{About, Known, MAX_ABOUT};
use super::decode::PhaseRow;
use super::fold::BlockSample;
use super::geometric::{Climb, Geometric};
use super::level::{Demodulated, Level};
use super::trust::Trust;
use super::wrapped::{WrappedRow, WrappedRowMut};
use crate::pattern::MAX_LEVELS;
use crate::simd::{Lanes, back_end_entry, plain};
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

#[inline(always)]
fn level_block<V: Lanes, T: BlockSample, const MODULATION: bool>(
    v: V,
    level: &Level,
    row: &LevelRow<'_, T>,
    at: usize,
) -> Demodulated<V> {
    match row {
        LevelRow::Frames(rows) => level.demodulate::<V, T, MODULATION>(v, rows, at),
        LevelRow::Wrapped(row) => row.block(v, at),
    }
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
    let finest = levels.len() - 1;
    let zero = v.splat16(0);
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let mut here = if finest == 0 {
            level_block::<V, T, true>(v, &levels[0], &rows[0], at)
        } else {
            level_block::<V, T, false>(v, &levels[0], &rows[0], at)
        };
        let dark = here.weak;
        if v.all8(dark) {
            let reason = v.splat8(Trust::Dark as u8);
            store_unknown(
                v,
                reason,
                (&mut *phases, &mut *modulations, &mut *trust),
                at,
            );
            continue;
        }
        let lowest = v.splat16(plan.lowest as i16);
        let mut low = Climb::<V> {
            order: zero,
            phase: v.sub(here.phase[0], lowest),
            doubtful: zero,
        };
        let mut high = Climb::<V> {
            order: zero,
            phase: v.sub(here.phase[1], lowest),
            doubtful: zero,
        };
        let mut weak = v.splat8(0);
        let mut saturated = here.saturated;
        for (place, step) in plan.steps.iter().enumerate() {
            let level = place + 1;
            here = if level == finest {
                level_block::<V, T, true>(v, &levels[level], &rows[level], at)
            } else {
                level_block::<V, T, false>(v, &levels[level], &rows[level], at)
            };
            weak = v.or8(weak, here.weak);
            saturated = v.or8(saturated, here.saturated);
            low = step.climb(v, low, here.phase[0]);
            high = step.climb(v, high, here.phase[1]);
        }
        let doubtful = v.narrow_mask([low.doubtful, high.doubtful]);
        let verdict = Verdict {
            dark,
            weak,
            saturated,
            doubtful,
        };
        let found = [v.join(low.phase, low.order), v.join(high.phase, high.order)];
        let origin = v.splat32(plan.origin);
        let found = [
            [v.add32(found[0][0], origin), v.add32(found[0][1], origin)],
            [v.add32(found[1][0], origin), v.add32(found[1][1], origin)],
        ];
        store(
            v,
            verdict.trust(v),
            v.or8(dark, weak),
            found,
            here.modulation,
            (&mut *phases, &mut *modulations, &mut *trust),
            at,
        );
    }
    if let Some(scale) = plan.scale {
        for phase in &mut phases[columns] {
            if *phase != AbsolutePhase::UNKNOWN.to_bits() {
                let scaled = (i64::from(*phase) * scale + (1 << 19)) >> 20;
                *phase = AbsolutePhase::saturate(scaled).to_bits();
            }
        }
    }
}

/// Why the pixels of a block are not trusted.
struct Verdict<B> {
    dark: B,
    weak: B,
    saturated: B,
    doubtful: B,
}

impl<B: Copy> Verdict<B> {
    /// The first reason of each pixel.
    #[inline(always)]
    fn trust<V: Lanes<B = B>>(&self, v: V) -> B {
        let trust = v.and8(self.doubtful, v.splat8(Trust::Residual as u8));
        let trust = v.pick8(self.saturated, v.splat8(Trust::Saturated as u8), trust);
        let trust = v.pick8(self.weak, v.splat8(Trust::LowModulation as u8), trust);
        v.pick8(self.dark, v.splat8(Trust::Dark as u8), trust)
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

/// Stores a block: the phase only where it is trusted, the modulation only where it is not weak.
#[inline(always)]
fn store<V: Lanes>(
    v: V,
    trust: V::B,
    weak: V::B,
    found: [[V::D; 2]; 2],
    modulation: [V::W; 2],
    (phases, modulations, trusts): Row<'_>,
    at: usize,
) {
    let trusted = v.eq8(trust, v.splat8(Trust::Resolved as u8));
    let trusted = v.widen(trusted, trusted);
    let (low, high) = (
        v.join(trusted[0], trusted[0]),
        v.join(trusted[1], trusted[1]),
    );
    let unknown = v.splat32(AbsolutePhase::UNKNOWN.to_bits());
    let known = [
        [
            v.pick32(low[0], found[0][0], unknown),
            v.pick32(low[1], found[0][1], unknown),
        ],
        [
            v.pick32(high[0], found[1][0], unknown),
            v.pick32(high[1], found[1][1], unknown),
        ],
    ];
    v.store32(phases, at, known);
    let weak = v.widen(weak, weak);
    let zero = v.splat16(0);
    let strong = [
        v.pick(weak[0], zero, v.add(modulation[0], modulation[0])),
        v.pick(weak[1], zero, v.add(modulation[1], modulation[1])),
    ];
    v.store16(modulations, at, strong);
    plain::store_trust(v, trusts, at, trust);
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
        let coarsest = level_block::<V, T, true>(v, &levels[0], &rows[0], at);
        let dark = v.or8(unexpected, coarsest.weak);
        if v.all8(dark) {
            let reason = v.pick8(
                unexpected,
                v.splat8(Trust::Unexpected as u8),
                v.splat8(Trust::Dark as u8),
            );
            store_unknown(
                v,
                reason,
                (&mut *phases, &mut *modulations, &mut *trust),
                at,
            );
            continue;
        }
        let mut found = [coarsest; MAX_ABOUT];
        let mut verdict = Verdict {
            dark: coarsest.weak,
            weak: v.splat8(0),
            saturated: coarsest.saturated,
            doubtful: v.splat8(0),
        };
        for (level, found) in found.iter_mut().enumerate().take(levels.len()).skip(1) {
            *found = level_block::<V, T, true>(v, &levels[level], &rows[level], at);
            verdict.weak = v.or8(verdict.weak, found.weak);
            verdict.saturated = v.or8(verdict.saturated, found.saturated);
        }
        let low = plan.unwrap(v, Known { map: known[0] }, &found, 0);
        let high = plan.unwrap(v, Known { map: known[1] }, &found, 1);
        verdict.doubtful = v.narrow_mask([low.doubtful, high.doubtful]);
        let reason = v.pick8(
            unexpected,
            v.splat8(Trust::Unexpected as u8),
            verdict.trust(v),
        );
        let weak = v.or8(unexpected, v.or8(verdict.dark, verdict.weak));
        store(
            v,
            reason,
            weak,
            [low.phase, high.phase],
            [low.modulation, high.modulation],
            (&mut *phases, &mut *modulations, &mut *trust),
            at,
        );
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
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        if before.is_some_and(|before| v.all8(before.weak(v, at))) {
            out.store_weak(v, at);
            continue;
        }
        let found = level.demodulate::<V, T, true>(v, row, at);
        out.store(v, at, &found);
    }
}
