//! A pixel: the height that it sees, and its deviation from golden between four heights.

use crate::inspect::weight::Factor;
use crate::math::nearest::BELOW;
use crate::pipeline::SQUARE;
use crate::units::Height;

/// The height that an offset leads to, nm.
#[inline(always)]
pub fn height(base: Height, offset: i32) -> i32 {
    let base = if base.is_known() { base.nm() } else { 0 };
    base.wrapping_add(offset)
}

/// How far a pixel at height `z` that moves up by `rise` lies above golden, nm. It lies between
/// four corners (left and right, above and below), at these shares of the way from the first one
/// along and down.
#[inline(always)]
pub fn deviation_of((z, rise): (i32, f32), (along, down): (f32, f32), corners: [i32; 4]) -> f32 {
    let [first, right, under, both] = corners;
    let upper = right.wrapping_sub(first);
    let lower = both.wrapping_sub(under);
    let twist = lower.wrapping_sub(upper) as f32;
    let under = under.wrapping_sub(first) as f32;
    let golden = along * upper as f32 + down * (under + along * twist);
    let above = z.wrapping_sub(first) as f32;
    (above + rise) - golden
}

/// A deviation in nm times a factor in its units.
#[inline(always)]
pub fn scaled(nm: f32, units: i32) -> f32 {
    nm * (units as f32 * Factor::UNIT as f32)
}

/// Whether a deviation in nm is so small that [`whole`](crate::math::nearest::whole) rounds it.
#[inline(always)]
pub fn is_small(nm: f32) -> bool {
    (nm > -(BELOW as f32)) & (nm < BELOW as f32)
}

/// Shifts [`SQUARE`] to the sign of 32 bits.
const TO_SIGN: u32 = SQUARE.leading_zeros() + 16;

/// All bits if the part is compared at the four pixels from a taught one on, else none; in as many
/// bits as heights have, because narrower masks would have to be widened.
#[inline(always)]
pub fn square(taught: i32) -> i32 {
    (taught << TO_SIGN) >> 31
}

/// All bits, or none.
#[inline(always)]
pub fn mask(condition: bool) -> i32 {
    -i32::from(condition)
}

/// The first number where the mask is set, else the second.
#[inline(always)]
pub fn pick(mask: i32, a: i32, b: i32) -> i32 {
    (a & mask) | (b & !mask)
}
