//! The back-end without any particular instructions: arrays, written so that each line can be
//! checked against [`Lanes`].
//!
//! It is compiled only for tests, as the reference of the other back-ends, and for processors
//! without vector instructions. Its operations are not inlined, because kernels of hundreds of
//! inlined loops take minutes to compile.

use super::lanes::{Lanes, Scaled, operations, plain};
use crate::math::nearest;

/// Always available.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Portable;

impl Portable {
    /// Always.
    pub fn detect() -> Option<Self> {
        Some(Self)
    }
}

const BYTES: usize = 16;
const WORDS: usize = BYTES / 2;
const DOUBLES: usize = BYTES / 4;

#[inline(always)]
fn lanes<T: Copy, R: Copy + Default, const N: usize>(a: [T; N], f: impl Fn(T) -> R) -> [R; N] {
    let mut out = [R::default(); N];
    for (out, a) in out.iter_mut().zip(a) {
        *out = f(a);
    }
    out
}

#[inline(always)]
fn pairs<T: Copy, R: Copy + Default, const N: usize>(
    a: [T; N],
    b: [T; N],
    f: impl Fn(T, T) -> R,
) -> [R; N] {
    let mut out = [R::default(); N];
    for (out, (a, b)) in out.iter_mut().zip(a.into_iter().zip(b)) {
        *out = f(a, b);
    }
    out
}

/// The halves of a block.
#[inline(always)]
fn halves<T: Copy, R>(block: [T; BYTES], f: impl Fn([T; WORDS]) -> R) -> [R; 2] {
    [0, WORDS].map(|start| f(core::array::from_fn(|lane| block[start + lane])))
}

/// The quarters of half a block.
#[inline(always)]
fn quarters<T: Copy>(half: [T; WORDS]) -> [[T; DOUBLES]; 2] {
    [0, DOUBLES].map(|start| core::array::from_fn(|lane| half[start + lane]))
}

#[inline(always)]
fn whole<T: Copy, const HALF: usize, const WHOLE: usize>(halves: [[T; HALF]; 2]) -> [T; WHOLE] {
    core::array::from_fn(|lane| halves[lane / HALF][lane % HALF])
}

fn mask8(set: bool) -> u8 {
    if set { u8::MAX } else { 0 }
}

fn mask16(set: bool) -> i16 {
    -i16::from(set)
}

fn mask32(set: bool) -> i32 {
    -i32::from(set)
}

type B = [u8; BYTES];
type W = [i16; WORDS];
type D = [i32; DOUBLES];
type F = [f32; DOUBLES];
type Count = u8;

/// Operations on two `$type`, lane by lane, as `name = function;`.
macro_rules! lanewise {
    ($type:ident; $($name:ident = $function:expr;)*) => {
        operations! { plain, never;
            $($name(self, a: $type, b: $type) -> $type = pairs(a, b, $function);)*
        }
    };
}

impl Lanes for Portable {
    const PIXELS: usize = BYTES;
    /// Nothing is prefetched.
    const AHEAD: usize = 0;
    type B = B;
    type Bound = u8;
    type W = W;
    type D = D;
    type F = F;
    type Count = Count;

    lanewise! { B;
        min8 = u8::min;
        max8 = u8::max;
        sub8 = u8::wrapping_sub;
        eq8 = |a, b| mask8(a == b);
        and8 = |a, b| a & b;
        or8 = |a, b| a | b;
        xor8 = |a, b| a ^ b;
    }
    lanewise! { W;
        add = i16::wrapping_add;
        sub = i16::wrapping_sub;
        add_sat = i16::saturating_add;
        mul_q15 = |a, b| ((i32::from(a) * i32::from(b) + (1 << 14)) >> 15) as i16;
        mul_low = i16::wrapping_mul;
        mean = |a, b| ((u32::from(a.cast_unsigned()) + u32::from(b.cast_unsigned())).div_ceil(2) as u16).cast_signed();
        min = i16::min;
        max = i16::max;
        max_unsigned = |a, b| a.cast_unsigned().max(b.cast_unsigned()).cast_signed();
        gt = |a, b| mask16(a > b);
        eq = |a, b| mask16(a == b);
        and = |a, b| a & b;
        or = |a, b| a | b;
        xor = |a, b| a ^ b;
    }
    lanewise! { D;
        add32 = i32::wrapping_add;
        gt32 = |a, b| mask32(a > b);
    }
    lanewise! { F;
        mul_single = |a, b| a * b;
    }

    operations! { plain, never;
        splat8(self, x: u8) -> B = [x; BYTES];
        load8(self, from: &[u8], at: usize) -> B = core::array::from_fn(|lane| from[at + lane]);
        bound(self, x: u8) -> u8 = x;
        all_at_least(self, x: B, bound: u8) -> bool = x.iter().all(|&x| x >= bound);
        all_at_most(self, x: B, bound: u8) -> bool = x.iter().all(|&x| x <= bound);
        all8(self, mask: B) -> bool = mask == [u8::MAX; BYTES];
        none8(self, bytes: B) -> bool = bytes == [0; BYTES];
        sum(self, a: B, b: B) -> [W; 2] = halves(pairs(a, b, |a, b| i16::from(a) + i16::from(b)), |half| half);
        difference(self, a: B, b: B) -> [W; 2] = halves(pairs(a, b, |a, b| i16::from(a) - i16::from(b)), |half| half);
        signs(self, mask: B) -> [W; 2] = halves(mask, |mask| lanes(mask, |mask| if mask == 0 { 1 } else { -1 }));
        widen_128(self, x: B) -> [W; 2] = halves(x, |x| lanes(x, |x| i16::from(x) << 7));
        bytes_of(self, x: W) -> B = core::array::from_fn(|lane| x[lane / 2].to_le_bytes()[lane % 2]);
        narrow_mask(self, mask: [W; 2]) -> B = lanes(whole::<_, WORDS, BYTES>(mask), |mask: i16| mask as u8);
        splat16(self, x: i16) -> W = [x; WORDS];
        sign_of(self, x: W) -> W = lanes(x, |x| if x < 0 { -1 } else { 1 });
        add_signed(self, a: W, b: W, sign: W) -> W = self.add(a, pairs(b, sign, i16::wrapping_mul));
        left(self, n: u8) -> Count = n;
        right(self, n: u8) -> Count = n;
        shl_by(self, x: W, n: u8) -> W = lanes(x, |x| x.checked_shl(u32::from(n)).unwrap_or(0));
        sar_by(self, x: W, n: u8) -> W = lanes(x, |x| x >> n);
        shr_by(self, x: W, n: u8) -> W = lanes(x, |x| (x.cast_unsigned() >> n).cast_signed());
        halve(self, x: W) -> W = lanes(x, |x| x.cast_unsigned().div_ceil(2).cast_signed());
        abs(self, x: W) -> W = lanes(x, i16::wrapping_abs);
        narrow_mask32(self, mask: [D; 2]) -> W = lanes(whole::<_, DOUBLES, WORDS>(mask), |mask: i32| mask as i16);
        splat32(self, x: i32) -> D = [x; DOUBLES];
        sar32_by(self, x: D, n: u8) -> D = lanes(x, |x| x >> n);
        to_single(self, x: D) -> F = lanes(x, |x| x as f32);
        to_whole(self, x: F) -> D = lanes(x, nearest::whole);
        splat_single(self, x: f32) -> F = [x; DOUBLES];
    }

    #[inline(always)]
    fn fetch<T>(self, _row: &[T], _at: usize, _after: usize) {}
    #[inline(always)]
    fn claim_ahead<T>(self, _row: &[T], _at: usize) {}
    #[inline(never)]
    fn store8(self, to: &mut [u8], at: usize, x: Self::B) {
        to[at..at + BYTES].copy_from_slice(&x);
    }
    #[inline(never)]
    fn pick8(self, mask: Self::B, a: Self::B, b: Self::B) -> Self::B {
        let b = pairs(mask, b, |mask, b| !mask & b);
        self.or8(self.and8(mask, a), b)
    }
    #[inline(never)]
    fn widen(self, low: Self::B, high: Self::B) -> [Self::W; 2] {
        let words: [i16; BYTES] = pairs(low, high, |low, high| i16::from_le_bytes([low, high]));
        halves(words, |half| half)
    }
    #[inline(never)]
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W> {
        let mut scaled = [[0; BYTES]; 3];
        for lane in 0..BYTES {
            let n = 7 + long[lane].leading_zeros();
            let long = i16::from(long[lane]) << n;
            scaled[0][lane] = long;
            scaled[1][lane] = i16::from(short[lane]) << n;
            scaled[2][lane] = (long << 2) ^ i16::MIN;
        }
        let [long, short, centred] = scaled.map(|block| halves(block, |half| half));
        Scaled {
            long,
            short,
            centred,
        }
    }
    #[inline(never)]
    fn load16(self, from: &[u16], at: usize) -> [Self::W; 2] {
        let block: [u16; BYTES] = core::array::from_fn(|lane| from[at + lane]);
        halves(block, |half| lanes(half, u16::cast_signed))
    }
    #[inline(never)]
    fn store16(self, to: &mut [u16], at: usize, x: [Self::W; 2]) {
        to[at..at + BYTES].copy_from_slice(&lanes(whole::<_, WORDS, BYTES>(x), i16::cast_unsigned));
    }
    #[inline(never)]
    fn shl<const N: i32>(self, x: Self::W) -> Self::W {
        lanes(x, |x| x << N)
    }
    #[inline(never)]
    fn sar<const N: i32>(self, x: Self::W) -> Self::W {
        lanes(x, |x| x >> N)
    }
    #[inline(never)]
    fn pick(self, mask: Self::W, a: Self::W, b: Self::W) -> Self::W {
        let b = pairs(mask, b, |mask, b| !mask & b);
        self.or(self.and(mask, a), b)
    }

    #[inline(never)]
    fn normalised(self, long: Self::W, short: Self::W) -> [Self::W; 2] {
        let n = lanes(long, |long| long.leading_zeros().clamp(1, 5) as i16 - 1);
        [long, short].map(|x| pairs(x, n, |x, n| x << n))
    }
    #[inline(never)]
    fn join(self, low: Self::W, high: Self::W) -> [Self::D; 2] {
        let joined: [i32; WORDS] = pairs(low, high, |low, high| {
            i32::from(low.cast_unsigned()) | (i32::from(high) << 16)
        });
        quarters(joined)
    }
    #[inline(never)]
    fn split(self, x: [Self::D; 2]) -> (Self::W, Self::W) {
        let x = whole::<_, DOUBLES, WORDS>(x);
        (lanes(x, |x| x as i16), lanes(x, |x| (x >> 16) as i16))
    }
    #[inline(never)]
    fn dot(self, a: Self::W, b: Self::W, c: Self::W, d: Self::W) -> [Self::D; 2] {
        let product = |a, b| pairs(a, b, |a, b| i32::from(a) * i32::from(b));
        let sum: [i32; WORDS] = pairs(product(a, b), product(c, d), i32::wrapping_add);
        quarters(sum)
    }
    #[inline(never)]
    fn dot_pair(self, a: Self::W, c: Self::W, bd: Self::D) -> [Self::D; 2] {
        let (b, d) = (bd[0] as i16, (bd[0] >> 16) as i16);
        self.dot(a, [b; WORDS], c, [d; WORDS])
    }
    #[inline(never)]
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W {
        let half = (1_i32 << n) >> 1;
        lanes(whole::<_, DOUBLES, WORDS>(x), |x: i32| {
            let rounded = x.wrapping_add(half) >> n;
            rounded.clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
        })
    }
    #[inline(never)]
    fn load32(self, from: &[i32], at: usize) -> [[Self::D; 2]; 2] {
        let block: [i32; BYTES] = core::array::from_fn(|lane| from[at + lane]);
        halves(block, quarters)
    }
    #[inline(never)]
    fn store32(self, to: &mut [i32], at: usize, x: [[Self::D; 2]; 2]) {
        let block = &mut to[at..at + BYTES];
        for (to, x) in block.chunks_exact_mut(DOUBLES).zip(x.as_flattened()) {
            to.copy_from_slice(x);
        }
    }
    #[inline(never)]
    fn pick32(self, mask: Self::D, a: Self::D, b: Self::D) -> Self::D {
        let a = pairs(mask, a, |mask, a| mask & a);
        let b = pairs(mask, b, |mask, b| !mask & b);
        pairs(a, b, |a, b| a | b)
    }
}
