//! Geometric levels in one pass over the frames of all of them.

use super::on_arrival::{arrive_row, top_row};
use super::quality::unless_dark;
use super::temporal::{Ground, Rung, four};
use super::{STRETCH, next_block, of_stretch, stretches};
use crate::phase::fold::BlockSample;
use crate::phase::geometric::Geometric;
use crate::phase::level::{Level, LevelLanes};
use crate::phase::narrow::FewClimbed;
use crate::phase::source::Frames;
use crate::simd::{Backend, Four, Lanes, Results, back_end_entry};
use crate::trust::Trust;
use core::ops::Range;

/// Decodes columns of a row: the rows of each level's frames, coarse to fine, in the order of their shifts.
pub(crate) fn climb_row<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: Range<usize>,
    mut out: Results<'_>,
) {
    let part = columns.clone();
    let fours: heapless::Vec<Four<'_, T>, 3> = (levels.iter().zip(rows))
        .map_while(|(level, rows)| four(level, rows, &columns))
        .take(3)
        .collect();
    let out = &mut out;
    let width = rows
        .iter()
        .flat_map(|rows| rows.iter())
        .map(|row| row.len())
        .next()
        .unwrap_or(0);
    match (rows, &fours[..]) {
        (&[a], _) => single(backend, plan, levels, a, columns, out),
        (&[_, _], &[a, b]) => fused(backend, plan, levels, (a, [], b), width, columns, out),
        (&[_, _, _], &[a, b, c]) => fused(backend, plan, levels, (a, [b], c), width, columns, out),
        (&[a, b, c], _) => fused(backend, plan, levels, (a, [b], c), width, columns, out),
        _ => in_turn(backend, plan, levels, rows, columns, out),
    }
    plan.finish(&mut out.phase[part]);
}

/// One level after the other, stretch by stretch.
fn in_turn<T: BlockSample>(
    backend: Backend,
    plan: &Geometric,
    levels: &[Level],
    rows: &[&[&[T]]],
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let (Some((finest, coarser)), Some((last, rows))) = (levels.split_last(), rows.split_last())
    else {
        return;
    };
    let mut climbed = FewClimbed::<STRETCH>::new();
    for stretch in stretches(columns) {
        let (columns, mut out) = (0..stretch.len(), out.part(&stretch));
        for (at, (level, rows)) in coarser.iter().zip(rows).enumerate() {
            let (rows, row) = (of_stretch(rows, &stretch), climbed.row_mut());
            arrive_row(backend, plan, at, level, &rows, columns.clone(), row);
        }
        let (rows, before) = (of_stretch(last, &stretch), climbed.row());
        top_row(backend, plan, finest, &rows, before, columns, &mut out);
    }
}

back_end_entry! {
    fn single [S: Frames] = single_columns(
        plan: &Geometric,
        levels: &[Level],
        frames: S,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

back_end_entry! {
    fn fused [S: Frames, const BETWEEN: usize] = fused_columns(
        plan: &Geometric,
        levels: &[Level],
        frames: (S, [S; BETWEEN], S),
        width: usize,
        columns: Range<usize>,
        out: &mut Results<'_>,
    )
}

#[inline(always)]
fn single_columns<V: Lanes, S: Frames>(
    v: V,
    plan: &Geometric,
    levels: &[Level],
    frames: S,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let [level] = levels else { return };
    let ground = Ground::new(v, plan);
    let level = LevelLanes::new(v, level);
    let (frames, mut out) = (frames.first(columns.end), out.first(columns.end));
    let mut start = columns.start;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = frames.fold(v, &level, at, V::AHEAD);
        let (block, modulation) = level.fine(v, &ground.angle, &folded, S::DOUBLED);
        let climb = ground.start(v, block.phase, &folded);
        let before = unless_dark(v, folded.strong);
        ground.store(v, &climb, before, modulation, at, &mut out);
    }
}

#[inline(always)]
fn fused_columns<V: Lanes, S: Frames, const BETWEEN: usize>(
    v: V,
    plan: &Geometric,
    levels: &[Level],
    (coarsest, between, finest): (S, [S; BETWEEN], S),
    width: usize,
    columns: Range<usize>,
    out: &mut Results<'_>,
) {
    let ([first, middle @ .., last], [steps @ .., step]) = (levels, &plan.steps[..]) else {
        return;
    };
    let ground = Ground::new(v, plan);
    let mut out = out.first(columns.end);
    let (coarsest, finest) = (coarsest.first(columns.end), finest.first(columns.end));
    let level = LevelLanes::new(v, first);
    let finest = Rung::new(v, step, last, finest);
    let mut rungs = [finest; BETWEEN];
    for (rung, ((step, level), frames)) in
        rungs.iter_mut().zip(steps.iter().zip(middle).zip(between))
    {
        *rung = Rung::new(v, step, level, frames.first(columns.end));
    }
    let mut start = columns.start;
    let mut after = V::AHEAD;
    while let Some(at) = next_block::<V>(start, &columns) {
        start += V::PIXELS;
        let folded = coarsest.fold(v, &level, at, V::AHEAD);
        let lit = folded.strong;
        if v.none8(lit) {
            out.store_unknown(v, at, v.splat8(Trust::Dark as u8));
            // Only some columns are lit, most likely those that will be in the next row.
            after = width;
            continue;
        }
        let climb = ground.start(v, ground.rough(v, &folded), &folded);
        // At most one level is between.
        let below = match rungs.first() {
            None => climb.ahead_of_start(v, &finest.step),
            Some(rung) => {
                let below = climb.ahead_of_start(v, &rung.step);
                let climb = rung.rough(v, &ground, &below, at, after);
                climb.ahead(v, &finest.step)
            }
        };
        let (climb, modulation) = finest.fine(v, &ground, &below, at, after);
        ground.store(v, &climb, unless_dark(v, lit), modulation, at, &mut out);
    }
}
