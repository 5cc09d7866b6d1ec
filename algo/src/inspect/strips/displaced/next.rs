//! Blocks whose pixels have one of four neighbouring whole displacements.

use super::block::Block;
use super::linear::BLOCK;
use super::pixel::{deviation_of, height, is_small, mask, pick, scaled, square};
use super::row::{Deviations, GoldenMap};
use crate::math::nearest::whole;
use crate::pipeline::NO_OFFSET;
use crate::simd::{Lanes, back_end_entry};
use core::hint::black_box;

back_end_entry! {
    /// Aligns a whole block whose pixels have one of four neighbouring whole displacements. `done`
    /// becomes false if they have not, or if some deviation is not small.
    fn align_next [] = next(
        golden: GoldenMap<'_>,
        block: &Block<'_>,
        out: &mut Deviations<'_>,
        done: &mut bool,
    )
}

#[inline(always)]
fn next<V: Lanes>(
    _: V,
    golden: GoldenMap<'_>,
    block: &Block<'_>,
    out: &mut Deviations<'_>,
    done: &mut bool,
) {
    *done = false;
    let (from, [left, top]) = (block.from.pixels(), block.from.lower(block.numbers));
    let from = [from[0] + left, from[1] + top];
    let place = match golden.inside((block.u, block.v), from, 3) {
        Some((place, pixels)) if out.height.len() == BLOCK && pixels >= BLOCK + 2 => place,
        _ => return,
    };
    let below = place + golden.width;
    let (Some(first), Some(second), Some(third), Some(upper), Some(lower), Some(high), Some(low)) = (
        neighbours(golden.height, place),
        neighbours(golden.height, below),
        neighbours(golden.height, below + golden.width),
        neighbours(golden.taught, place),
        neighbours(golden.taught, below),
        neighbours(golden.factor, place),
        neighbours(golden.factor, below),
    ) else {
        return;
    };
    let (bases, offsets) = (&block.bases[..BLOCK], &block.offsets[..BLOCK]);
    let linear = block.linear;
    let (heights, normals) = (&mut out.height[..BLOCK], &mut out.normal[..BLOCK]);
    let (left, top) = (left as f32, top as f32);
    let mut refused = 0;
    for i in 0..BLOCK {
        let z = height(bases[i], offsets[i]);
        let [along, down, rise] = linear.at(i, z);
        let inside = lies_in(along, left) & lies_in(down, top);
        let (right, under) = (mask(along >= left + 1.0), mask(down >= top + 1.0));
        let shares = (
            along - if right != 0 { left + 1.0 } else { left },
            down - if under != 0 { top + 1.0 } else { top },
        );
        let near = [
            pick(right, first[1][i].nm(), first[0][i].nm()),
            pick(right, second[1][i].nm(), second[0][i].nm()),
            pick(right, third[1][i].nm(), third[0][i].nm()),
        ];
        let far = [
            pick(right, first[2][i].nm(), first[1][i].nm()),
            pick(right, second[2][i].nm(), second[1][i].nm()),
            pick(right, third[2][i].nm(), third[1][i].nm()),
        ];
        let corners = [
            pick(under, near[1], near[0]),
            pick(under, far[1], far[0]),
            pick(under, near[2], near[1]),
            pick(under, far[2], far[1]),
        ];
        let taught = pick(
            under,
            pick(right, lower[1][i].into(), lower[0][i].into()),
            pick(right, upper[1][i].into(), upper[0][i].into()),
        );
        let nm = deviation_of((z, rise), shares, corners);
        let units = pick(
            under,
            pick(right, low[1][i].units(), low[0][i].units()),
            pick(right, high[1][i].units(), high[0][i].units()),
        );
        let measured = mask(offsets[i] != NO_OFFSET);
        let known = measured & square(taught);
        heights[i] = pick(known, whole(nm), NO_OFFSET);
        normals[i] = pick(known, whole(scaled(nm, units)), NO_OFFSET);
        refused |= (measured & !inside) | (known & !mask(is_small(nm)));
    }
    *done = refused == 0;
}

/// The elements at the places of a block from the first on, and those one and two places to the
/// right. The compiler does not see that these overlap: it would hand elements on from pixel to
/// pixel, instead of working on many pixels at a time.
#[inline(always)]
fn neighbours<T>(map: &[T], place: usize) -> Option<[&[T; BLOCK]; 3]> {
    let all = map.get(place..place + BLOCK + 2)?;
    Some([
        all.first_chunk()?,
        black_box(all[1..].first_chunk()?),
        black_box(all[2..].first_chunk()?),
    ])
}

/// Whether a displacement is at least `low` and less than two pixels more: a mask.
#[inline(always)]
fn lies_in(displacement: f32, low: f32) -> i32 {
    mask(displacement >= low) & mask(displacement < low + 2.0)
}
