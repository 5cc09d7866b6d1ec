//! Lanes without instructions of any particular machine: arrays, written so that each line can be checked against the
//! definition. The oracle of the other back-ends, and the fallback. Its operations are not inlined: kernels made of
//! hundreds of them, lane by lane, take the compiler minutes.

use super::lanes::{Lanes, Scaled};
use super::rows::Four;

/// May always be used.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

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

impl Lanes for Portable {
    const PIXELS: usize = BYTES;
    /// Nothing is fetched.
    const AHEAD: usize = 0;
    type B = [u8; BYTES];
    type W = [i16; WORDS];
    type D = [i32; DOUBLES];
    type F = [f32; DOUBLES];
    type Count = u8;

    #[inline(never)]
    fn splat8(self, x: u8) -> Self::B {
        [x; BYTES]
    }
    #[inline(never)]
    fn load8(self, from: &[u8], at: usize) -> Self::B {
        core::array::from_fn(|lane| from[at + lane])
    }
    #[inline(never)]
    fn load8_of_four(self, from: &Four<'_, u8>, at: usize) -> [Self::B; 4] {
        from.rows().map(|row| self.load8(row, at))
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
    fn min8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, u8::min)
    }
    #[inline(never)]
    fn max8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, u8::max)
    }
    #[inline(never)]
    fn sub8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, u8::wrapping_sub)
    }
    #[inline(never)]
    fn eq8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, |a, b| mask8(a == b))
    }
    #[inline(never)]
    fn and8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, |a, b| a & b)
    }
    #[inline(never)]
    fn or8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, |a, b| a | b)
    }
    #[inline(never)]
    fn xor8(self, a: Self::B, b: Self::B) -> Self::B {
        pairs(a, b, |a, b| a ^ b)
    }
    #[inline(never)]
    fn pick8(self, mask: Self::B, a: Self::B, b: Self::B) -> Self::B {
        let b = pairs(mask, b, |mask, b| !mask & b);
        self.or8(self.and8(mask, a), b)
    }
    #[inline(never)]
    fn quarters8(self, half: Self::B, quarter: Self::B) -> Self::B {
        pairs(half, quarter, |half, quarter| half & 128 | quarter & 64)
    }
    #[inline(never)]
    fn by_excess(self, table: &[u8; 16], x: Self::B) -> Self::B {
        lanes(x, |x| match x {
            0..16 => table[0],
            16..32 => table[usize::from(x - 16)],
            _ => 0,
        })
    }
    #[inline(never)]
    fn all8(self, mask: Self::B) -> bool {
        mask == [u8::MAX; BYTES]
    }

    #[inline(never)]
    fn none8(self, mask: Self::B) -> bool {
        mask == [0; BYTES]
    }

    #[inline(never)]
    fn widen(self, low: Self::B, high: Self::B) -> [Self::W; 2] {
        let words: [i16; BYTES] = pairs(low, high, |low, high| i16::from_le_bytes([low, high]));
        halves(words, |half| half)
    }
    #[inline(never)]
    fn signs(self, mask: Self::B) -> [Self::W; 2] {
        halves(mask, |mask| {
            lanes(mask, |mask| if mask == 0 { 1 } else { -1 })
        })
    }
    #[inline(never)]
    fn widen_256(self, x: Self::B) -> [Self::W; 2] {
        self.widen([0; BYTES], x)
    }
    #[inline(never)]
    fn widen_128(self, x: Self::B) -> [Self::W; 2] {
        halves(x, |x| lanes(x, |x| i16::from(x) << 7))
    }
    #[inline(never)]
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W> {
        let mut scaled = [[0; BYTES]; 3];
        for lane in 0..BYTES {
            let n = 7 + long[lane].leading_zeros().min(3);
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
    fn narrow_mask(self, mask: [Self::W; 2]) -> Self::B {
        lanes(whole::<_, WORDS, BYTES>(mask), |mask: i16| mask as u8)
    }

    #[inline(never)]
    fn splat16(self, x: i16) -> Self::W {
        [x; WORDS]
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
    fn add(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, i16::wrapping_add)
    }
    #[inline(never)]
    fn sub(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, i16::wrapping_sub)
    }
    #[inline(never)]
    fn add_signed(self, a: Self::W, b: Self::W, sign: Self::W) -> Self::W {
        self.add(a, pairs(b, sign, i16::wrapping_mul))
    }
    #[inline(never)]
    fn add_sat(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, i16::saturating_add)
    }
    #[inline(never)]
    fn mul_q15(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| {
            ((i32::from(a) * i32::from(b) + (1 << 14)) >> 15) as i16
        })
    }
    #[inline(never)]
    fn mul_low(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, i16::wrapping_mul)
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
    fn left(self, n: u8) -> Self::Count {
        n
    }
    #[inline(never)]
    fn right(self, n: u8) -> Self::Count {
        n
    }
    #[inline(never)]
    fn shl_by(self, x: Self::W, n: u8) -> Self::W {
        lanes(x, |x| x.checked_shl(u32::from(n)).unwrap_or(0))
    }
    #[inline(never)]
    fn sar_by(self, x: Self::W, n: u8) -> Self::W {
        lanes(x, |x| x >> n)
    }
    #[inline(never)]
    fn shr_by(self, x: Self::W, n: u8) -> Self::W {
        lanes(x, |x| (x.cast_unsigned() >> n).cast_signed())
    }
    #[inline(never)]
    fn halve(self, x: Self::W) -> Self::W {
        lanes(x, |x| x.cast_unsigned().div_ceil(2).cast_signed())
    }
    #[inline(never)]
    fn abs(self, x: Self::W) -> Self::W {
        lanes(x, i16::wrapping_abs)
    }
    #[inline(never)]
    fn min(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, i16::min)
    }
    #[inline(never)]
    fn max(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, i16::max)
    }
    #[inline(never)]
    fn max_unsigned(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| {
            a.cast_unsigned().max(b.cast_unsigned()).cast_signed()
        })
    }
    #[inline(never)]
    fn gt(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| mask16(a > b))
    }
    #[inline(never)]
    fn eq(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| mask16(a == b))
    }
    #[inline(never)]
    fn and(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| a & b)
    }
    #[inline(never)]
    fn or(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| a | b)
    }
    #[inline(never)]
    fn xor(self, a: Self::W, b: Self::W) -> Self::W {
        pairs(a, b, |a, b| a ^ b)
    }
    #[inline(never)]
    fn pick(self, mask: Self::W, a: Self::W, b: Self::W) -> Self::W {
        let b = pairs(mask, b, |mask, b| !mask & b);
        self.or(self.and(mask, a), b)
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
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W {
        let half = (1_i32 << n) >> 1;
        lanes(whole::<_, DOUBLES, WORDS>(x), |x: i32| {
            let rounded = x.wrapping_add(half) >> n;
            rounded.clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
        })
    }
    #[inline(never)]
    fn narrow_mask32(self, mask: [Self::D; 2]) -> Self::W {
        lanes(whole::<_, DOUBLES, WORDS>(mask), |mask: i32| mask as i16)
    }

    #[inline(never)]
    fn splat32(self, x: i32) -> Self::D {
        [x; DOUBLES]
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
    fn add32(self, a: Self::D, b: Self::D) -> Self::D {
        pairs(a, b, i32::wrapping_add)
    }
    #[inline(never)]
    fn sar32_by(self, x: Self::D, n: u8) -> Self::D {
        lanes(x, |x| x >> n)
    }
    #[inline(never)]
    fn gt32(self, a: Self::D, b: Self::D) -> Self::D {
        pairs(a, b, |a, b| mask32(a > b))
    }
    #[inline(never)]
    fn pick32(self, mask: Self::D, a: Self::D, b: Self::D) -> Self::D {
        let a = pairs(mask, a, |mask, a| mask & a);
        let b = pairs(mask, b, |mask, b| !mask & b);
        pairs(a, b, |a, b| a | b)
    }
    #[inline(never)]
    fn to_single(self, x: Self::D) -> Self::F {
        lanes(x, |x| x as f32)
    }
    #[inline(never)]
    fn to_whole(self, x: Self::F) -> Self::D {
        // Above 2²³ the singles are the whole numbers.
        const WHOLE: f32 = 12_582_912.0;
        lanes(x, |x| {
            let shifted = (x + WHOLE).to_bits().cast_signed();
            shifted.wrapping_sub(WHOLE.to_bits().cast_signed())
        })
    }
    #[inline(never)]
    fn splat_single(self, x: f32) -> Self::F {
        [x; DOUBLES]
    }
    #[inline(never)]
    fn add_single(self, a: Self::F, b: Self::F) -> Self::F {
        pairs(a, b, |a, b| a + b)
    }
    #[inline(never)]
    fn mul_single(self, a: Self::F, b: Self::F) -> Self::F {
        pairs(a, b, |a, b| a * b)
    }
    #[inline(never)]
    fn lt_single(self, a: Self::F, b: Self::F) -> Self::D {
        pairs(a, b, |a, b| mask32(a < b))
    }
}
