//! Rounding singles below 2²² to the nearest whole number, ties to even, by two additions: the same
//! on every machine.

/// Magnitudes below this are rounded.
pub(crate) const BELOW: u32 = 1 << 22;

/// 1.5 · 2²³: added to a single below 2²², it leaves the nearest whole number in the low bits.
const ROUNDER: f32 = 12_582_912.0;

/// The nearest whole number as a single.
#[inline(always)]
pub(crate) fn nearest(x: f32) -> f32 {
    (x + ROUNDER) - ROUNDER
}

/// The nearest whole number.
#[inline(always)]
pub(crate) fn whole(x: f32) -> i32 {
    ((x + ROUNDER).to_bits() as i32).wrapping_sub(ROUNDER.to_bits() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_to_the_even_number() {
        for (x, expected) in [
            (0.5, 0),
            (1.5, 2),
            (-0.5, 0),
            (-2.5, -2),
            (2.49, 2),
            (4_194_303.5, 4_194_304),
        ] {
            assert_eq!(whole(x), expected, "{x}");
            assert_eq!(nearest(x), expected as f32, "{x}");
        }
    }
}
