//! The back-end of aarch64, where NEON is always available.

use super::lanes::{Lanes, Scaled, operations, pairs};
use super::rows::{block, block_mut};
use core::arch::aarch64::*;
use core::arch::asm;

/// Needs no proof: NEON is part of aarch64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Neon;

impl Neon {
    /// Always.
    pub fn detect() -> Option<Self> {
        Some(Self)
    }
}

const BYTES: usize = 16;

/// Calls intrinsics of NEON.
macro_rules! neon {
    ($e:expr) => {{
        // SAFETY: every aarch64 processor that this is compiled for has NEON, the only condition of
        // intrinsics on values.
        unsafe { $e }
    }};
}

/// One instruction that changes its first operand, in lanes of this form. Of the intrinsics with
/// the same result the compiler makes two or three: it computes the inverse of a mask, or adds in
/// an order of its own.
macro_rules! in_place {
    ($instruction:literal, $lanes:literal, $a:expr, $b:expr, $c:expr) => {{
        let mut a = $a;
        // SAFETY: an instruction of NEON that reads and writes registers only.
        unsafe {
            asm!(
                concat!($instruction, " {0:v}.", $lanes, ", {1:v}.", $lanes, ", {2:v}.", $lanes),
                inout(vreg) a,
                in(vreg) $b,
                in(vreg) $c,
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        a
    }};
}

type B = uint8x16_t;
type W = int16x8_t;
type D = int32x4_t;
type F = float32x4_t;
type Count = int16x8_t;

impl Lanes for Neon {
    const PIXELS: usize = BYTES;
    const FEW_REGISTERS: bool = false;
    const LIFTS_FAINT: bool = false;
    /// Nothing is prefetched.
    const AHEAD: usize = 0;
    type B = B;
    type Bound = u8;
    type W = W;
    type D = D;
    type F = F;
    type Count = Count;

    pairs! { neon, always, B;
        min8 = vminq_u8;
        max8 = vmaxq_u8;
        sub8 = vsubq_u8;
        eq8 = vceqq_u8;
        and8 = vandq_u8;
        or8 = vorrq_u8;
        xor8 = veorq_u8;
        excess8 = vqsubq_u8;
    }
    pairs! { neon, always, W;
        add = vaddq_s16;
        sub = vsubq_s16;
        add_sat = vqaddq_s16;
        mul_q15 = vqrdmulhq_s16;
        mul_low = vmulq_s16;
        min = vminq_s16;
        max = vmaxq_s16;
        and = vandq_s16;
        or = vorrq_s16;
        xor = veorq_s16;
    }
    pairs! { neon, always, D;
        add32 = vaddq_s32;
    }
    pairs! { neon, always, F;
        mul_single = vmulq_f32;
    }

    operations! { neon, always;
        splat8(self, x: u8) -> B = vdupq_n_u8(x);
        pick8(self, mask: B, a: B, b: B) -> B = vbslq_u8(mask, a, b);
        bytes_of(self, x: W) -> B = vreinterpretq_u8_s16(x);
        narrow_mask(self, mask: [W; 2]) -> B = vuzp1q_u8(vreinterpretq_u8_s16(mask[0]), vreinterpretq_u8_s16(mask[1]));
        splat16(self, x: i16) -> W = vdupq_n_s16(x);
        sign_of(self, x: W) -> W = vorrq_s16(vshrq_n_s16::<15>(x), vdupq_n_s16(1));
        add_signed(self, a: W, b: W, sign: W) -> W = vmlaq_s16(a, b, sign);
        left(self, n: u8) -> Count = vdupq_n_s16(i16::from(n));
        right(self, n: u8) -> Count = vdupq_n_s16(-i16::from(n));
        shl_by(self, x: W, n: Count) -> W = vshlq_s16(x, n);
        sar_by(self, x: W, n: Count) -> W = vshlq_s16(x, n);
        shr_by(self, x: W, n: Count) -> W = vreinterpretq_s16_u16(vshlq_u16(vreinterpretq_u16_s16(x), n));
        halve(self, x: W) -> W = vreinterpretq_s16_u16(vrshrq_n_u16::<1>(vreinterpretq_u16_s16(x)));
        mean(self, a: W, b: W) -> W = vreinterpretq_s16_u16(vrhaddq_u16(vreinterpretq_u16_s16(a), vreinterpretq_u16_s16(b)));
        abs(self, x: W) -> W = vabsq_s16(x);
        excess(self, a: W, b: W) -> W = vreinterpretq_s16_u16(vqsubq_u16(vreinterpretq_u16_s16(a), vreinterpretq_u16_s16(b)));
        max_unsigned(self, a: W, b: W) -> W = vreinterpretq_s16_u16(vmaxq_u16(vreinterpretq_u16_s16(a), vreinterpretq_u16_s16(b)));
        gt(self, a: W, b: W) -> W = vreinterpretq_s16_u16(vcgtq_s16(a, b));
        eq(self, a: W, b: W) -> W = vreinterpretq_s16_u16(vceqq_s16(a, b));
        pick(self, mask: W, a: W, b: W) -> W = vbslq_s16(vreinterpretq_u16_s16(mask), a, b);
        narrow_mask32(self, mask: [D; 2]) -> W = vuzp1q_s16(vreinterpretq_s16_s32(mask[0]), vreinterpretq_s16_s32(mask[1]));
        splat32(self, x: i32) -> D = vdupq_n_s32(x);
        sar32_by(self, x: D, n: u8) -> D = vshlq_s32(x, vdupq_n_s32(-i32::from(n)));
        gt32(self, a: D, b: D) -> D = vreinterpretq_s32_u32(vcgtq_s32(a, b));
        pick32(self, mask: D, a: D, b: D) -> D = vbslq_s32(vreinterpretq_u32_s32(mask), a, b);
        to_single(self, x: D) -> F = vcvtq_f32_s32(x);
        to_whole(self, x: F) -> D = vcvtnq_s32_f32(x);
        splat_single(self, x: f32) -> F = vdupq_n_f32(x);
    }

    #[inline(always)]
    fn load8(self, from: &[u8], at: usize) -> Self::B {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 16 bytes that are read.
        unsafe { vld1q_u8(block.as_ptr()) }
    }
    #[inline(always)]
    fn fetch<T>(self, _row: &[T], _at: usize, _after: usize) {}
    #[inline(always)]
    fn claim_ahead<T>(self, _row: &[T], _at: usize) {}
    #[inline(always)]
    fn store8(self, to: &mut [u8], at: usize, x: Self::B) {
        let block = block_mut(to, at, BYTES);
        // SAFETY: the slice holds the 16 bytes that are written.
        unsafe { vst1q_u8(block.as_mut_ptr(), x) }
    }
    #[inline(always)]
    fn quarters8(self, mask: Self::B, s: Self::B, c: Self::B) -> Self::B {
        let mut half = c;
        // SAFETY: an instruction of NEON that reads and writes registers only. It names what
        // kernels compute of the same masks, so that this is done before and no copy of the one
        // that changes is needed.
        unsafe {
            asm!(
                "bit {0:v}.16b, {1:v}.16b, {2:v}.16b // {3:v}",
                inout(vreg) half,
                in(vreg) s,
                in(vreg) mask,
                in(vreg) self.xor8(s, c),
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        // Shifts to the right that round make 128 and 64 of 255.
        neon!(vrsraq_n_u8::<2>(vrshrq_n_u8::<1>(half), mask))
    }
    #[inline(always)]
    fn bound(self, x: u8) -> Self::Bound {
        x
    }
    #[inline(always)]
    fn all_at_least(self, x: Self::B, bound: Self::Bound) -> bool {
        neon!(vminvq_u8(x)) >= bound
    }
    #[inline(always)]
    fn all_at_most(self, x: Self::B, bound: Self::Bound) -> bool {
        neon!(vmaxvq_u8(x)) <= bound
    }
    #[inline(always)]
    fn all8(self, mask: Self::B) -> bool {
        neon!(vminvq_u8(mask)) == u8::MAX
    }

    #[inline(always)]
    fn none8(self, bytes: Self::B) -> bool {
        neon!(vmaxvq_u8(bytes)) == 0
    }

    #[inline(always)]
    fn widen(self, low: Self::B, high: Self::B) -> [Self::W; 2] {
        neon!([
            vreinterpretq_s16_u8(vzip1q_u8(low, high)),
            vreinterpretq_s16_u8(vzip2q_u8(low, high))
        ])
    }
    #[inline(always)]
    fn sum(self, a: Self::B, b: Self::B) -> [Self::W; 2] {
        neon!([
            vreinterpretq_s16_u16(vaddl_u8(vget_low_u8(a), vget_low_u8(b))),
            vreinterpretq_s16_u16(vaddl_high_u8(a, b))
        ])
    }
    #[inline(always)]
    fn difference(self, a: Self::B, b: Self::B) -> [Self::W; 2] {
        neon!([
            vreinterpretq_s16_u16(vsubl_u8(vget_low_u8(a), vget_low_u8(b))),
            vreinterpretq_s16_u16(vsubl_high_u8(a, b))
        ])
    }
    #[inline(always)]
    fn signs(self, mask: Self::B) -> [Self::W; 2] {
        let signs = neon!(vreinterpretq_s8_u8(vorrq_u8(mask, vdupq_n_u8(1))));
        neon!([vmovl_s8(vget_low_s8(signs)), vmovl_high_s8(signs)])
    }
    #[inline(always)]
    fn widen_128(self, x: Self::B) -> [Self::W; 2] {
        neon!([
            vreinterpretq_s16_u16(vshll_n_u8::<7>(vget_low_u8(x))),
            vreinterpretq_s16_u16(vshll_high_n_u8::<7>(x))
        ])
    }
    #[inline(always)]
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W> {
        let (long, short) = neon!({
            let n = vreinterpretq_s8_u8(vclzq_u8(long));
            (vshlq_u8(long, n), vshlq_u8(short, n))
        });
        // The upper byte of 4 · long − 3 · 2¹⁵: the longer without its leading bit, doubled, with
        // its sign bit inverted.
        let centred = neon!(veorq_u8(vshlq_n_u8::<1>(long), vdupq_n_u8(128)));
        Scaled {
            long: self.widen_128(long),
            short: self.widen_128(short),
            centred: self.widen(self.splat8(0), centred),
        }
    }
    #[inline(always)]
    fn load16(self, from: &[u16], at: usize) -> [Self::W; 2] {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 16 words that are read, 8 at a time.
        let [low, high] = unsafe { [vld1q_u16(block.as_ptr()), vld1q_u16(block.as_ptr().add(8))] };
        neon!([vreinterpretq_s16_u16(low), vreinterpretq_s16_u16(high)])
    }
    #[inline(always)]
    fn store16(self, to: &mut [u16], at: usize, x: [Self::W; 2]) {
        let block = block_mut(to, at, BYTES);
        // SAFETY: the slice holds the 16 words that are written, 8 at a time.
        unsafe {
            vst1q_u16(block.as_mut_ptr(), vreinterpretq_u16_s16(x[0]));
            vst1q_u16(block.as_mut_ptr().add(8), vreinterpretq_u16_s16(x[1]));
        }
    }
    #[inline(always)]
    fn shl<const N: i32>(self, x: Self::W) -> Self::W {
        neon!(vshlq_n_s16::<N>(x))
    }
    #[inline(always)]
    fn sar<const N: i32>(self, x: Self::W) -> Self::W {
        neon!(vshrq_n_s16::<N>(x))
    }
    #[inline(always)]
    fn normalised(self, long: Self::W, short: Self::W) -> [Self::W; 2] {
        neon!({
            // The bits after the sign that equal it.
            let n = vclsq_s16(long);
            [vshlq_s16(long, n), vshlq_s16(short, n)]
        })
    }
    #[inline(always)]
    fn join(self, low: Self::W, high: Self::W) -> [Self::D; 2] {
        neon!([
            vreinterpretq_s32_s16(vzip1q_s16(low, high)),
            vreinterpretq_s32_s16(vzip2q_s16(low, high))
        ])
    }
    #[inline(always)]
    fn split(self, x: [Self::D; 2]) -> (Self::W, Self::W) {
        neon!({
            let (a, b) = (vreinterpretq_s16_s32(x[0]), vreinterpretq_s16_s32(x[1]));
            (vuzp1q_s16(a, b), vuzp2q_s16(a, b))
        })
    }
    #[inline(always)]
    fn dot(self, a: Self::W, b: Self::W, c: Self::W, d: Self::W) -> [Self::D; 2] {
        neon!({
            let low = vmull_s16(vget_low_s16(a), vget_low_s16(b));
            let high = vmull_high_s16(a, b);
            [
                vmlal_s16(low, vget_low_s16(c), vget_low_s16(d)),
                vmlal_high_s16(high, c, d),
            ]
        })
    }
    #[inline(always)]
    fn dot_pair(self, a: Self::W, c: Self::W, bd: Self::D) -> [Self::D; 2] {
        neon!({
            let bd = vreinterpretq_s16_s32(bd);
            let low = vmull_laneq_s16::<0>(vget_low_s16(a), bd);
            let high = vmull_high_laneq_s16::<0>(a, bd);
            [
                vmlal_laneq_s16::<1>(low, vget_low_s16(c), bd),
                vmlal_high_laneq_s16::<1>(high, c, bd),
            ]
        })
    }
    #[inline(always)]
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W {
        neon!({
            let down = vdupq_n_s32(-i32::from(n));
            let low = vqmovn_s32(vrshlq_s32(x[0], down));
            vqmovn_high_s32(low, vrshlq_s32(x[1], down))
        })
    }
    #[inline(always)]
    fn narrow_rounded_by<const N: i32>(self, x: [Self::D; 2]) -> Self::W {
        neon!(vqrshrn_high_n_s32::<N>(vqrshrn_n_s32::<N>(x[0]), x[1]))
    }
    #[inline(always)]
    fn load32(self, from: &[i32], at: usize) -> [[Self::D; 2]; 2] {
        let block = block(from, at, BYTES);
        // SAFETY: the slice holds the 16 double words that are read, 4 at a time.
        unsafe {
            let start = block.as_ptr();
            [
                [vld1q_s32(start), vld1q_s32(start.add(4))],
                [vld1q_s32(start.add(8)), vld1q_s32(start.add(12))],
            ]
        }
    }
    #[inline(always)]
    fn add32_rounded<const N: i32>(self, a: Self::D, x: Self::D) -> Self::D {
        neon!(vrsraq_n_s32::<N>(a, x))
    }
    #[inline(always)]
    fn merge(self, mask: Self::W, a: Self::W, b: Self::W) -> Self::W {
        in_place!("bit", "16b", b, a, mask)
    }
    #[inline(always)]
    fn store32_joined(self, to: &mut [i32], at: usize, low: [Self::W; 2], high: [Self::W; 2]) {
        let block = block_mut(to, at, BYTES);
        let start = block.as_mut_ptr().cast();
        // SAFETY: the slice holds the 16 double words that are written as pairs of words, 8 at a
        // time; the lower word comes first.
        unsafe {
            vst2q_s16(start, int16x8x2_t(low[0], high[0]));
            vst2q_s16(start.add(16), int16x8x2_t(low[1], high[1]));
        }
    }
    #[inline(always)]
    fn store32(self, to: &mut [i32], at: usize, x: [[Self::D; 2]; 2]) {
        let block = block_mut(to, at, BYTES);
        // SAFETY: the slice holds the 16 double words that are written, 4 at a time.
        unsafe {
            vst1q_s32(block.as_mut_ptr(), x[0][0]);
            vst1q_s32(block.as_mut_ptr().add(4), x[0][1]);
            vst1q_s32(block.as_mut_ptr().add(8), x[1][0]);
            vst1q_s32(block.as_mut_ptr().add(12), x[1][1]);
        }
    }
}
