//! Blocks whose pixels all have one whole displacement.

use super::block::{
    Deviations, GoldenMap, OffsetRow, deviation_of, height, mask, pick, scaled, square,
};
use super::linear::{BLOCK, Linear, Whole};
use crate::math::nearest::{BELOW, whole};
use crate::pipeline::NO_OFFSET;
use crate::simd::{Lanes, back_end_entry};
use core::ops::Range;

back_end_entry! {
    /// Aligns whole blocks from the first column on, as long as all their pixels have the whole
    /// displacement of the first block's middle, and small deviations. `done` becomes their number.
    fn align_same [] = same(
        golden: GoldenMap<'_>,
        row: OffsetRow<'_>,
        columns: Range<usize>,
        out: &mut Deviations<'_>,
        done: &mut usize,
    )
}

#[inline(always)]
fn same<V: Lanes>(
    v: V,
    golden: GoldenMap<'_>,
    row: OffsetRow<'_>,
    columns: Range<usize>,
    out: &mut Deviations<'_>,
    done: &mut usize,
) {
    *done = 0;
    let blocks = &row.blocks[columns.start / BLOCK..][..columns.len() / BLOCK];
    let Some(from) = blocks.first().and_then(Whole::of) else {
        return;
    };
    let Some((place, pixels)) = golden.inside((columns.start, row.v), from.pixels(), 2) else {
        return;
    };
    let pixels = columns.len().min(pixels - 1) / BLOCK * BLOCK;
    let base = row.v * golden.width + columns.start;
    let below = place + golden.width;
    // What the next row reads and this one does not.
    let ahead = (base + golden.width).max(below + golden.width);
    let seen = chunks(golden.height, base, pixels).zip(chunks(row.offset, columns.start, pixels));
    let upper = chunks(golden.height, place, pixels).zip(chunks(golden.height, place + 1, pixels));
    let lower = chunks(golden.height, below, pixels).zip(chunks(golden.height, below + 1, pixels));
    let taught = chunks(golden.taught, place, pixels).zip(chunks(golden.factor, place, pixels));
    let columns = columns.start..columns.start + pixels;
    let heights = out.height[columns.clone()].as_chunks_mut::<BLOCK>().0;
    let normals = out.normal[columns].as_chunks_mut::<BLOCK>().0;
    let out = heights.iter_mut().zip(normals);
    let mut blocks_done = 0;
    for ((numbers, (bases, offsets)), (((upper, lower), (taught, factors)), (heights, normals))) in
        blocks
            .iter()
            .zip(seen)
            .zip(upper.zip(lower).zip(taught).zip(out))
    {
        v.fetch(golden.height, ahead + blocks_done * BLOCK, 0);
        let mut measured = 0;
        for offset in offsets {
            measured |= mask(*offset != NO_OFFSET);
        }
        if measured == 0 {
            // Beside the part, and in its openings.
            heights.fill(NO_OFFSET);
            normals.fill(NO_OFFSET);
            blocks_done += 1;
            continue;
        }
        if !from.fits(numbers) {
            break;
        }
        let linear = Linear::of(numbers, from);
        let (mut farthest, mut largest) = (0, 0);
        for i in 0..BLOCK {
            let z = height(bases[i], offsets[i]);
            let [along, down, rise] = linear.at(i, z);
            let corners = [
                upper.0[i].nm(),
                upper.1[i].nm(),
                lower.0[i].nm(),
                lower.1[i].nm(),
            ];
            let nm = deviation_of((z, rise), (along, down), corners);
            let measured = mask(offsets[i] != NO_OFFSET);
            let known = measured & square(taught[i].into());
            heights[i] = pick(known, whole(nm), NO_OFFSET);
            normals[i] = pick(known, whole(scaled(nm, factors[i].units())), NO_OFFSET);
            farthest = farthest.max(order(along).max(order(down)) & measured.cast_unsigned());
            largest = largest.max(order(nm.abs()) & known.cast_unsigned());
        }
        if farthest >= order(1.0) || largest >= order(BELOW as f32) {
            break;
        }
        blocks_done += 1;
    }
    *done = blocks_done;
}

/// Blocks of pixels from a place of a map on.
#[inline(always)]
fn chunks<T>(map: &[T], place: usize, pixels: usize) -> core::slice::Iter<'_, [T; BLOCK]> {
    map[place..][..pixels].as_chunks::<BLOCK>().0.iter()
}

/// The bits of a number: from 0 up in the order of the numbers; those of negative ones and NaN are
/// larger than all others.
#[inline(always)]
fn order(number: f32) -> u32 {
    number.to_bits()
}
