//! The sample types of frames, and what the kernels need of a block of samples: bytes of 8 bits,
//! words of 9 to 16.

use super::level::{LevelLanes, lift_of};
use crate::frame::Sample;
use crate::simd::Lanes;

/// A sample type that the kernels can read blocks of.
pub(crate) trait BlockSample: Sample {
    /// A block of samples as it is loaded.
    type Block<V: Lanes>: Copy;

    /// The rows as bytes, if samples are bytes.
    fn bytes<'r, 'a, const N: usize>(rows: &'r [&'a [Self]; N]) -> Option<&'r [&'a [u8]; N]>;
    /// The block of `row` that starts at `at`.
    fn load<V: Lanes>(v: V, row: &[Self], at: usize) -> Self::Block<V>;
    /// As words, moved up to 16 bits and counted from the middle of their range.
    fn centred<V: Lanes>(v: V, level: &LevelLanes<'_, V>, block: Self::Block<V>) -> [V::W; 2];
    /// Samples of 16 bits as words, counted from the middle of their range.
    fn centred_16<V: Lanes>(v: V, block: Self::Block<V>) -> [V::W; 2];
    /// a + b, of at most 15 bits.
    fn sum<V: Lanes>(v: V, a: Self::Block<V>, b: Self::Block<V>) -> [V::W; 2];
    /// a − b, of at most 15 bits.
    fn difference<V: Lanes>(v: V, a: Self::Block<V>, b: Self::Block<V>) -> [V::W; 2];
    /// Bits by which differences of N = 3, 4 or 6 samples are shifted left to fill words, less one,
    /// and as they are.
    fn lift<V: Lanes, const N: usize>(v: V, level: &LevelLanes<'_, V>) -> [V::Count; 2];
    /// The brighter of two samples.
    fn brighter<V: Lanes>(v: V, a: Self::Block<V>, b: Self::Block<V>) -> Self::Block<V>;
    /// S or C from a sum of products ([`super::level::Demodulation::Terms`]).
    fn rounded<V: Lanes>(v: V, level: &LevelLanes<'_, V>, sum: [V::D; 2]) -> V::W;
    /// 255 where the sample is at full scale or above, less elsewhere.
    fn saturated<V: Lanes>(v: V, level: &LevelLanes<'_, V>, block: Self::Block<V>) -> V::B;
}

impl BlockSample for u8 {
    type Block<V: Lanes> = V::B;

    fn bytes<'r, 'a, const N: usize>(rows: &'r [&'a [Self]; N]) -> Option<&'r [&'a [u8]; N]> {
        Some(rows)
    }
    #[inline(always)]
    fn load<V: Lanes>(v: V, row: &[Self], at: usize) -> V::B {
        v.load8(row, at)
    }
    #[inline(always)]
    fn centred<V: Lanes>(v: V, _level: &LevelLanes<'_, V>, block: V::B) -> [V::W; 2] {
        Self::centred_16(v, block)
    }
    #[inline(always)]
    fn centred_16<V: Lanes>(v: V, block: V::B) -> [V::W; 2] {
        v.widen_256(v.xor8(block, v.splat8(128)))
    }
    #[inline(always)]
    fn sum<V: Lanes>(v: V, a: V::B, b: V::B) -> [V::W; 2] {
        v.sum(a, b)
    }
    #[inline(always)]
    fn difference<V: Lanes>(v: V, a: V::B, b: V::B) -> [V::W; 2] {
        v.difference(a, b)
    }
    #[inline(always)]
    fn lift<V: Lanes, const N: usize>(v: V, _level: &LevelLanes<'_, V>) -> [V::Count; 2] {
        // Known to the compiler: a shift by a number in a register takes twice as long with AVX2.
        let lift = const { lift_of(8, N) };
        [v.left(lift - 1), v.left(lift)]
    }
    #[inline(always)]
    fn brighter<V: Lanes>(v: V, a: V::B, b: V::B) -> V::B {
        v.max8(a, b)
    }
    #[inline(always)]
    fn rounded<V: Lanes>(v: V, _level: &LevelLanes<'_, V>, sum: [V::D; 2]) -> V::W {
        v.narrow_rounded_by::<8>(sum)
    }
    #[inline(always)]
    fn saturated<V: Lanes>(_v: V, _level: &LevelLanes<'_, V>, block: V::B) -> V::B {
        block
    }
}

impl BlockSample for u16 {
    type Block<V: Lanes> = [V::W; 2];

    fn bytes<'r, 'a, const N: usize>(_rows: &'r [&'a [Self]; N]) -> Option<&'r [&'a [u8]; N]> {
        None
    }
    #[inline(always)]
    fn load<V: Lanes>(v: V, row: &[Self], at: usize) -> [V::W; 2] {
        v.load16(row, at)
    }
    #[inline(always)]
    fn centred<V: Lanes>(v: V, level: &LevelLanes<'_, V>, [low, high]: [V::W; 2]) -> [V::W; 2] {
        let middle = v.splat16(i16::MIN);
        [
            v.xor(v.shl_by(low, level.to_16_bits), middle),
            v.xor(v.shl_by(high, level.to_16_bits), middle),
        ]
    }
    #[inline(always)]
    fn centred_16<V: Lanes>(v: V, [low, high]: [V::W; 2]) -> [V::W; 2] {
        let middle = v.splat16(i16::MIN);
        [v.xor(low, middle), v.xor(high, middle)]
    }
    #[inline(always)]
    fn sum<V: Lanes>(v: V, a: [V::W; 2], b: [V::W; 2]) -> [V::W; 2] {
        [v.add(a[0], b[0]), v.add(a[1], b[1])]
    }
    #[inline(always)]
    fn difference<V: Lanes>(v: V, a: [V::W; 2], b: [V::W; 2]) -> [V::W; 2] {
        [v.sub(a[0], b[0]), v.sub(a[1], b[1])]
    }
    #[inline(always)]
    fn lift<V: Lanes, const N: usize>(_v: V, level: &LevelLanes<'_, V>) -> [V::Count; 2] {
        [level.half_lift, level.lift]
    }
    #[inline(always)]
    fn brighter<V: Lanes>(v: V, a: [V::W; 2], b: [V::W; 2]) -> [V::W; 2] {
        [v.max_unsigned(a[0], b[0]), v.max_unsigned(a[1], b[1])]
    }
    #[inline(always)]
    fn rounded<V: Lanes>(v: V, level: &LevelLanes<'_, V>, sum: [V::D; 2]) -> V::W {
        v.narrow_rounded(sum, level.plan.down)
    }
    #[inline(always)]
    fn saturated<V: Lanes>(v: V, level: &LevelLanes<'_, V>, [low, high]: [V::W; 2]) -> V::B {
        // With the sign bit inverted, signed comparison orders unsigned words.
        let turn = v.splat16(i16::MIN);
        v.narrow_mask([
            v.gt(v.xor(low, turn), level.below_full_scale),
            v.gt(v.xor(high, turn), level.below_full_scale),
        ])
    }
}
