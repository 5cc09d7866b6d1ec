//! The operations that a back-end provides: a block of pixels as lanes of 8, 16 and 32 bits.
//!
//! A block is [`Lanes::PIXELS`] neighbouring pixels of a row: one vector of bytes, two of words
//! (`[W; 2]`), four of double words. Each back-end may distribute the pixels over these halves in
//! its own way: its loads and widening operations agree with its stores and narrowing operations,
//! so kernels do not depend on it.
//!
//! Every operation has one result on every machine: it is integer, or IEEE 754 single precision
//! with + − ×. Words are signed or unsigned as the operation says; overflow wraps around unless the
//! name says otherwise. Loads and stores panic outside of their slice.

use core::fmt::Debug;

/// Pixels of the widest block of any back-end, or more.
pub(crate) const MAX_PIXELS: usize = 64;

/// The components of the pointers of a block, scaled by a power of two (see [`Lanes::scaled`]).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scaled<W> {
    /// The longer, 2¹⁴…2¹⁵.
    pub long: [W; 2],
    /// The shorter.
    pub short: [W; 2],
    /// 4 · long − 3 · 2¹⁵: the longer about the middle of its range, −2¹⁵…2¹⁵.
    pub centred: [W; 2],
}

/// A back-end. A value of it proves that its instructions are available on this machine.
///
/// Operations with a body are composed of others; a back-end defines them itself only where it has
/// a shorter way.
pub(crate) trait Lanes: Copy + Debug {
    /// Pixels of a block.
    const PIXELS: usize;
    /// Whether there are too few registers for the constants of a kernel.
    const FEW_REGISTERS: bool = true;
    /// Whether [`Self::normalised`] needs components of at least 2¹⁰; else it takes shorter ones,
    /// too.
    const LIFTS_FAINT: bool = true;
    /// How many samples ahead of their use rows are prefetched.
    const AHEAD: usize;
    /// A byte per pixel of a block.
    type B: Copy;
    /// A number that bytes are compared with.
    type Bound: Copy;
    /// A word per pixel of half a block.
    type W: Copy;
    /// A double word per pixel of a quarter of a block.
    type D: Copy;
    /// A single-precision number per pixel of a quarter of a block.
    type F: Copy;
    /// A number of bits to shift by.
    type Count: Copy;

    // Bytes. Masks are 0 or 255.

    /// Every pixel `x`.
    fn splat8(self, x: u8) -> Self::B;
    /// The block of `from` that starts at `at`.
    fn load8(self, from: &[u8], at: usize) -> Self::B;
    /// Prefetches the samples `after` samples behind the block at `at`. `after` is [`Self::AHEAD`]
    /// where whole rows are read, because rows follow one another in memory; where only some
    /// columns of each row are read it is the length of a row, so that the same columns of the next
    /// row are prefetched.
    fn fetch<T>(self, row: &[T], at: usize, after: usize);
    /// Prefetches for writing, [`Self::AHEAD`] samples behind the block at `at`.
    fn claim_ahead<T>(self, row: &[T], at: usize);
    /// Writes the block of `to` that starts at `at`.
    fn store8(self, to: &mut [u8], at: usize, x: Self::B);
    /// The smaller.
    fn min8(self, a: Self::B, b: Self::B) -> Self::B;
    /// The larger.
    fn max8(self, a: Self::B, b: Self::B) -> Self::B;
    /// a − b.
    fn sub8(self, a: Self::B, b: Self::B) -> Self::B;
    /// Mask: a = b.
    fn eq8(self, a: Self::B, b: Self::B) -> Self::B;
    /// Bits of both.
    fn and8(self, a: Self::B, b: Self::B) -> Self::B;
    /// Bits of either.
    fn or8(self, a: Self::B, b: Self::B) -> Self::B;
    /// Bits of just one.
    fn xor8(self, a: Self::B, b: Self::B) -> Self::B;
    /// a where the mask is set, else b.
    fn pick8(self, mask: Self::B, a: Self::B, b: Self::B) -> Self::B;
    /// a − b, at least 0.
    #[inline(always)]
    fn excess8(self, a: Self::B, b: Self::B) -> Self::B {
        self.sub8(self.max8(a, b), b)
    }
    /// The sum of 128 where `s` (or `c`, for pixels where `mask` is not set) is set, and of 64
    /// where `mask` is set. All three are masks.
    #[inline(always)]
    fn quarters8(self, mask: Self::B, s: Self::B, c: Self::B) -> Self::B {
        let half = self.and8(self.pick8(mask, s, c), self.splat8(128));
        self.or8(half, self.and8(mask, self.splat8(64)))
    }
    /// Prepares comparisons with x.
    fn bound(self, x: u8) -> Self::Bound;
    /// Whether every byte is at least the bound.
    fn all_at_least(self, x: Self::B, bound: Self::Bound) -> bool;
    /// Whether every byte is at most the bound.
    fn all_at_most(self, x: Self::B, bound: Self::Bound) -> bool;
    /// Whether every byte of a mask is set.
    fn all8(self, mask: Self::B) -> bool;
    /// Whether every byte is 0, of a mask or of any other bytes.
    fn none8(self, bytes: Self::B) -> bool;

    // Between bytes and words.

    /// Words low + 256 · high.
    fn widen(self, low: Self::B, high: Self::B) -> [Self::W; 2];
    /// Words a + b.
    fn sum(self, a: Self::B, b: Self::B) -> [Self::W; 2];
    /// Words a − b.
    fn difference(self, a: Self::B, b: Self::B) -> [Self::W; 2];
    /// Words −1 where a mask is set, else 1.
    #[inline(always)]
    fn signs(self, mask: Self::B) -> [Self::W; 2] {
        self.widen(self.or8(mask, self.splat8(1)), mask)
    }
    /// Words 256 · x.
    #[inline(always)]
    fn widen_256(self, x: Self::B) -> [Self::W; 2] {
        self.widen(self.splat8(0), x)
    }
    /// Words 128 · x.
    #[inline(always)]
    fn widen_128(self, x: Self::B) -> [Self::W; 2] {
        let [low, high] = self.widen(x, self.splat8(0));
        [self.shl::<7>(low), self.shl::<7>(high)]
    }
    /// Both as words times 128 · 2ⁿ, with n so that 2¹⁴ ≤ long < 2¹⁵. Unspecified where long < 4 or
    /// short > long.
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W>;
    /// The bytes of words, two per pixel, in any order.
    fn bytes_of(self, x: Self::W) -> Self::B;
    /// Masks of words as masks of bytes.
    fn narrow_mask(self, mask: [Self::W; 2]) -> Self::B;

    // Words. Masks are 0 or −1.

    /// Every pixel `x`.
    fn splat16(self, x: i16) -> Self::W;
    /// The block of `from` that starts at `at`.
    fn load16(self, from: &[u16], at: usize) -> [Self::W; 2];
    /// Writes the block of `to` that starts at `at`.
    fn store16(self, to: &mut [u16], at: usize, x: [Self::W; 2]);
    /// a + b.
    fn add(self, a: Self::W, b: Self::W) -> Self::W;
    /// a − b.
    fn sub(self, a: Self::W, b: Self::W) -> Self::W;
    /// The sign of x for [`Self::add_signed`]; 0 counts as positive.
    fn sign_of(self, x: Self::W) -> Self::W;
    /// a + b · sign, where the sign is 1 or −1, or comes from [`Self::sign_of`].
    fn add_signed(self, a: Self::W, b: Self::W, sign: Self::W) -> Self::W;
    /// a + b, signed, at most 32767.
    fn add_sat(self, a: Self::W, b: Self::W) -> Self::W;
    /// (a · b + 2¹⁴) / 2¹⁵ rounded down, signed; not for −32768 · −32768.
    fn mul_q15(self, a: Self::W, b: Self::W) -> Self::W;
    /// The low half of a · b.
    fn mul_low(self, a: Self::W, b: Self::W) -> Self::W;
    /// x · 2ⁿ.
    fn shl<const N: i32>(self, x: Self::W) -> Self::W;
    /// x / 2ⁿ rounded down, signed.
    fn sar<const N: i32>(self, x: Self::W) -> Self::W;
    /// Prepares shifts of words to the left by n up to 16.
    fn left(self, n: u8) -> Self::Count;
    /// Prepares shifts of words to the right by n below 16.
    fn right(self, n: u8) -> Self::Count;
    /// x · 2ⁿ.
    fn shl_by(self, x: Self::W, n: Self::Count) -> Self::W;
    /// x / 2ⁿ rounded down, signed.
    fn sar_by(self, x: Self::W, n: Self::Count) -> Self::W;
    /// x / 2ⁿ rounded down, unsigned.
    fn shr_by(self, x: Self::W, n: Self::Count) -> Self::W;
    /// (x + 1) / 2 rounded down, unsigned.
    fn halve(self, x: Self::W) -> Self::W;
    /// (a + b + 1) / 2 rounded down, unsigned.
    fn mean(self, a: Self::W, b: Self::W) -> Self::W;
    /// Both times 2ⁿ, with n from 0 to 4 so that 2¹⁴ ≤ long < 2¹⁵. Unspecified where long < 2¹⁰ or
    /// short > long.
    fn normalised(self, long: Self::W, short: Self::W) -> [Self::W; 2];
    /// |x|, 32768 of −32768 as an unsigned word.
    fn abs(self, x: Self::W) -> Self::W;
    /// a − b, unsigned, at least 0.
    #[inline(always)]
    fn excess(self, a: Self::W, b: Self::W) -> Self::W {
        self.sub(self.max_unsigned(a, b), b)
    }
    /// Whether no a < b, signed.
    #[inline(always)]
    fn none_below(self, a: Self::W, b: Self::W) -> bool {
        self.none8(self.bytes_of(self.gt(b, a)))
    }
    /// The smaller, signed.
    fn min(self, a: Self::W, b: Self::W) -> Self::W;
    /// The larger, signed.
    fn max(self, a: Self::W, b: Self::W) -> Self::W;
    /// The larger, unsigned.
    fn max_unsigned(self, a: Self::W, b: Self::W) -> Self::W;
    /// Mask: a > b, signed.
    fn gt(self, a: Self::W, b: Self::W) -> Self::W;
    /// Mask: a = b.
    fn eq(self, a: Self::W, b: Self::W) -> Self::W;
    /// Bits of both.
    fn and(self, a: Self::W, b: Self::W) -> Self::W;
    /// Bits of either.
    fn or(self, a: Self::W, b: Self::W) -> Self::W;
    /// Bits of just one.
    fn xor(self, a: Self::W, b: Self::W) -> Self::W;
    /// a where the mask is set, else b.
    fn pick(self, mask: Self::W, a: Self::W, b: Self::W) -> Self::W;
    /// The bits of a that are set in the mask, and those of b, which has none of them.
    #[inline(always)]
    fn merge(self, mask: Self::W, a: Self::W, b: Self::W) -> Self::W {
        self.or(self.and(mask, a), b)
    }

    // Between words and double words.

    /// Double words low + 65536 · high.
    fn join(self, low: Self::W, high: Self::W) -> [Self::D; 2];
    /// The low words (as they are) and the high words of x.
    fn split(self, x: [Self::D; 2]) -> (Self::W, Self::W);
    /// a · b + c · d, signed.
    fn dot(self, a: Self::W, b: Self::W, c: Self::W, d: Self::W) -> [Self::D; 2];
    /// a · b + c · d, signed, where each double word is b + 65536 · d: the same b and d for every
    /// pixel.
    fn dot_pair(self, a: Self::W, c: Self::W, bd: Self::D) -> [Self::D; 2];
    /// x / 2ⁿ rounded to nearest, signed and kept inside a word; n below 31, and x + 2ⁿ⁻¹ must not
    /// overflow.
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W;
    /// As [`Self::narrow_rounded`], for a fixed n from 1 to 16.
    #[inline(always)]
    fn narrow_rounded_by<const N: i32>(self, x: [Self::D; 2]) -> Self::W {
        self.narrow_rounded(x, N as u8)
    }
    /// Masks of double words as masks of words.
    fn narrow_mask32(self, mask: [Self::D; 2]) -> Self::W;

    // Double words and singles.

    /// Every pixel `x`.
    fn splat32(self, x: i32) -> Self::D;
    /// The block of `from` that starts at `at`.
    fn load32(self, from: &[i32], at: usize) -> [[Self::D; 2]; 2];
    /// Writes the block of `to` that starts at `at`, double words low + 65536 · high.
    #[inline(always)]
    fn store32_joined(self, to: &mut [i32], at: usize, low: [Self::W; 2], high: [Self::W; 2]) {
        let x = [self.join(low[0], high[0]), self.join(low[1], high[1])];
        self.store32(to, at, x);
    }
    /// Writes the block of `to` that starts at `at`.
    fn store32(self, to: &mut [i32], at: usize, x: [[Self::D; 2]; 2]);
    /// a + b.
    fn add32(self, a: Self::D, b: Self::D) -> Self::D;
    /// x / 2ⁿ rounded down, signed, n below 32.
    fn sar32_by(self, x: Self::D, n: u8) -> Self::D;
    /// a + x / 2ⁿ, that rounded to nearest, signed; n from 1 to 31, and x + 2ⁿ⁻¹ must not overflow.
    #[inline(always)]
    fn add32_rounded<const N: i32>(self, a: Self::D, x: Self::D) -> Self::D {
        let up = self.add32(x, self.splat32(1 << (N - 1)));
        self.add32(a, self.sar32_by(up, N as u8))
    }
    /// Mask: a > b, signed.
    fn gt32(self, a: Self::D, b: Self::D) -> Self::D;
    /// a where the mask is set, else b.
    fn pick32(self, mask: Self::D, a: Self::D, b: Self::D) -> Self::D;
    /// x rounded to the nearest single.
    fn to_single(self, x: Self::D) -> Self::F;
    /// x rounded to the nearest whole number, ties to even; |x| below 2²².
    fn to_whole(self, x: Self::F) -> Self::D;
    /// Every pixel `x`.
    fn splat_single(self, x: f32) -> Self::F;
    /// a · b.
    fn mul_single(self, a: Self::F, b: Self::F) -> Self::F;
}

/// Defines the operations of a back-end that are one expression each, as `name(self, arguments) ->
/// result = expression;`.
///
/// `$within` is the macro that the expression is wrapped in, `$inline` the argument of `#[inline]`.
macro_rules! operations {
    ($within:ident, $inline:ident;
        $($name:ident($self:ident $(, $arg:ident: $type:ty)*) -> $out:ty = $body:expr;)*) => {
        $(
            #[inline($inline)]
            fn $name($self $(, $arg: $type)*) -> $out {
                $within!($body)
            }
        )*
    };
}
pub(super) use operations;

/// Defines operations on two `$type` that result in one, as `name = function;`.
macro_rules! pairs {
    ($within:ident, $inline:ident, $type:ident; $($name:ident = $function:ident;)*) => {
        operations! { $within, $inline;
            $($name(self, a: $type, b: $type) -> $type = $function(a, b);)*
        }
    };
}
pub(super) use pairs;

/// The expression itself, for operations that need no proof.
#[cfg(any(test, not(target_arch = "aarch64")))]
macro_rules! plain {
    ($e:expr) => {
        $e
    };
}
#[cfg(any(test, not(target_arch = "aarch64")))]
pub(super) use plain;
