//! Every operation of every back-end gives the portable one's result, on random lanes.

use super::lanes::Lanes;
use super::{Backend, back_end_entry};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::vec::Vec;

/// Pixels of a row: a multiple of every back-end's block.
const WIDTH: usize = 64;

/// Rows of lanes, made anew for every round.
pub(super) struct Inputs {
    /// Two rows of any bytes, two of masks, and a pointer's components of 8 bits: 4 ≤ long, short ≤
    /// long.
    bytes: [[u8; WIDTH]; 6],
    /// Four rows of any words, and a pointer's components: 2¹⁰ ≤ long < 2¹⁵, short ≤ long.
    words: [[u16; WIDTH]; 6],
    /// Two rows of any double words, and one of at most 22 bits.
    doubles: [[i32; WIDTH]; 3],
    shift: u8,
}

impl Inputs {
    fn new(random: &mut SplitMix64) -> Self {
        let mut row = |lane: fn(i64) -> i64| -> [i64; WIDTH] {
            core::array::from_fn(|_| lane(random.next_u64().cast_signed()))
        };
        // Half of the lanes are at an edge of bytes, words or double words.
        let any = |x: i64| match x & 15 {
            0 => 0,
            1 => -1,
            2 => 0x80,
            3 => 0x7F,
            4 => -0x8000,
            5 => 0x7FFF,
            6 => i64::from(i32::MIN),
            7 => i64::from(i32::MAX),
            _ => x >> 24 >> (x >> 4 & 15),
        };
        let (long8, long16) = (
            row(|x| 4 + (((x & 0xFF) % 252) >> ((x >> 8) & 7))),
            row(|x| 1024 + (x & 0x3FFF)),
        );
        let up_to = |long: [i64; WIDTH], x: [i64; WIDTH]| {
            core::array::from_fn(|at| x[at].rem_euclid(long[at] + 1))
        };
        let short8 = up_to(long8, row(|x| x));
        let short16 = up_to(long16, row(|x| x));
        let mask = |x: i64| -(x & 1);
        let bytes = [row(any), row(any), row(mask), row(mask), long8, short8];
        let words = [row(any), row(any), row(any), row(any), long16, short16];
        let doubles = [row(any), row(any), row(|x| x >> 42)];
        Self {
            bytes: bytes.map(|row| row.map(|x| x as u8)),
            words: words.map(|row| row.map(|x| x as u16)),
            doubles: doubles.map(|row| row.map(|x| x as i32)),
            shift: row(|x| x & 15)[0] as u8,
        }
    }
}

/// Results by operation, in the order of the pixels.
pub(super) type Outputs = BTreeMap<&'static str, Vec<i32>>;

fn bytes<V: Lanes>(v: V, out: &mut Outputs, name: &'static str, x: V::B) {
    let mut row = [0; WIDTH];
    v.store8(&mut row, 0, x);
    let row = row[..V::PIXELS].iter().map(|&x| i32::from(x));
    out.entry(name).or_default().extend(row);
}

fn words<V: Lanes>(v: V, out: &mut Outputs, name: &'static str, x: [V::W; 2]) {
    let mut row = [0; WIDTH];
    v.store16(&mut row, 0, x);
    let row = row[..V::PIXELS].iter().map(|&x| i32::from(x));
    out.entry(name).or_default().extend(row);
}

fn doubles<V: Lanes>(v: V, out: &mut Outputs, name: &'static str, x: [[V::D; 2]; 2]) {
    let mut row = [0; WIDTH];
    v.store32(&mut row, 0, x);
    out.entry(name).or_default().extend(&row[..V::PIXELS]);
}

/// Stores what operations give for whole blocks, or for each half of blocks of words.
macro_rules! results {
    ($v:ident, $out:ident; $($kind:ident $name:ident($($arg:expr),*);)*) => {
        $($kind($v, $out, stringify!($name), $v.$name($($arg),*));)*
    };
    (halves $v:ident, $out:ident; $($kind:ident $name:ident $(::<$n:literal>)? ($($arg:ident),* $(; $same:expr)?);)*) => {
        $($kind($v, $out, stringify!($name), [
            $v.$name$(::<$n>)?($($arg[0]),* $(, $same)?),
            $v.$name$(::<$n>)?($($arg[1]),* $(, $same)?),
        ]);)*
    };
}

back_end_entry! {
    fn operate[] = operations(inputs: &Inputs, out: &mut Outputs)
}

#[inline(always)]
fn operations<V: Lanes>(v: V, inputs: &Inputs, out: &mut Outputs) {
    let mut at = 0;
    while at < WIDTH {
        operations_of_bytes(v, inputs, at, out);
        operations_of_words(v, inputs, at, out);
        operations_of_doubles(v, inputs, at, out);
        at += V::PIXELS;
    }
    for place in 0..V::PIXELS {
        let mut row = [0; WIDTH];
        assert!(v.none8(v.load8(&row, 0)));
        row[place] = 1;
        assert!(!v.none8(v.load8(&row, 0)), "pixel {place}");
        let mut row = [255; WIDTH];
        assert!(v.all8(v.load8(&row, 0)));
        row[place] = 0;
        assert!(!v.all8(v.load8(&row, 0)), "pixel {place}");
        let mut row = [130; WIDTH];
        row[place] = 129;
        let x = v.load8(&row, 0);
        let at_least = |bound| v.all_at_least(x, v.bound(bound));
        assert!(
            at_least(0) && at_least(129) && !at_least(130),
            "pixel {place}"
        );
        row[place] = 131;
        let x = v.load8(&row, 0);
        let at_most = |bound| v.all_at_most(x, v.bound(bound));
        assert!(
            at_most(255) && at_most(131) && !at_most(130),
            "pixel {place}"
        );
    }
}

#[inline(always)]
fn operations_of_bytes<V: Lanes>(v: V, inputs: &Inputs, at: usize, out: &mut Outputs) {
    let [a, b, mask, other, long, short] = &inputs.bytes;
    let (a, b) = (v.load8(a, at), v.load8(b, at));
    let (mask, other) = (v.load8(mask, at), v.load8(other, at));
    results! { v, out;
        bytes splat8(inputs.shift);
        bytes min8(a, b);
        bytes max8(a, b);
        bytes sub8(a, b);
        bytes eq8(a, b);
        bytes and8(a, b);
        bytes or8(a, b);
        bytes xor8(a, b);
        bytes pick8(mask, a, b);
        bytes excess8(a, b);
        bytes quarters8(mask, other, v.xor8(mask, other));
        words widen(a, b);
        words sum(a, b);
        words difference(a, b);
        words signs(mask);
        words widen_256(a);
        words widen_128(a);
        bytes narrow_mask(v.widen(mask, mask));
    }
    let scaled = v.scaled(v.load8(long, at), v.load8(short, at));
    words(v, out, "scaled long", scaled.long);
    words(v, out, "scaled short", scaled.short);
    words(v, out, "scaled centred", scaled.centred);
}

#[inline(always)]
fn operations_of_words<V: Lanes>(v: V, inputs: &Inputs, at: usize, out: &mut Outputs) {
    let mut rows = [v.load16(&inputs.words[0], at); 6];
    for (row, words) in rows.iter_mut().zip(&inputs.words) {
        *row = v.load16(words, at);
    }
    let [a, b, c, d, long, short] = rows;
    let mask = v.load8(&inputs.bytes[2], at);
    let mask = v.widen(mask, mask);
    let sign = [v.sign_of(c[0]), v.sign_of(c[1])];
    let others = [v.xor(v.or(b[0], c[0]), c[0]), v.xor(v.or(b[1], c[1]), c[1])];
    let odd = [v.or(b[0], v.splat16(1)), v.or(b[1], v.splat16(1))];
    results! { halves v, out;
        words add(a, b);
        words sub(a, b);
        words add_signed(a, b, sign);
        words add_sat(a, b);
        words mul_q15(a, odd);
        words mul_low(a, b);
        words shl::<7>(a);
        words sar::<15>(a);
        words shl_by(a; v.left(inputs.shift + 1));
        words sar_by(a; v.right(inputs.shift));
        words shr_by(a; v.right(inputs.shift));
        words halve(a);
        words mean(a, b);
        words abs(a);
        words min(a, b);
        words max(a, b);
        words max_unsigned(a, b);
        words gt(a, b);
        words eq(a, b);
        words and(a, b);
        words or(a, b);
        words xor(a, b);
        words pick(mask, a, b);
        words merge(c, a, others);
        doubles join(a, b);
        doubles dot(a, b, c, d);
        doubles dot_pair(a, b; v.splat32(inputs.doubles[0][0]));
    }
    words(v, out, "splat16", [v.splat16(-1234); 2]);
    let mut joined = [0; WIDTH];
    v.store32_joined(&mut joined, 0, a, b);
    let joined = &joined[..V::PIXELS];
    out.entry("store32_joined").or_default().extend(joined);
    let low = v.normalised(long[0], short[0]);
    let high = v.normalised(long[1], short[1]);
    words(v, out, "normalised long", [low[0], high[0]]);
    words(v, out, "normalised short", [low[1], high[1]]);
}

#[inline(always)]
fn operations_of_doubles<V: Lanes>(v: V, inputs: &Inputs, at: usize, out: &mut Outputs) {
    let [x, y, small] = &inputs.doubles;
    let (x, y, small) = (v.load32(x, at), v.load32(y, at), v.load32(small, at));
    let n = inputs.shift;
    let (low, high) = (v.split(x[0]), v.split(x[1]));
    words(v, out, "split low", [low.0, high.0]);
    words(v, out, "split high", [low.1, high.1]);
    let (mut greater, mut sum, mut shifted) = (x, x, x);
    let (mut picked, mut halved, mut rounded, mut single) = (x, x, x, x);
    for (half, quarter) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let (x, y) = (x[half][quarter], y[half][quarter]);
        greater[half][quarter] = v.gt32(x, y);
        sum[half][quarter] = v.add32(x, y);
        shifted[half][quarter] = v.sar32_by(x, n);
        picked[half][quarter] = v.pick32(v.gt32(x, y), x, y);
        halved[half][quarter] = v.sar32_by(x, 1);
        rounded[half][quarter] = v.add32_rounded::<14>(y, halved[half][quarter]);
        let product = v.mul_single(v.to_single(small[half][quarter]), v.splat_single(0.5));
        single[half][quarter] = v.to_whole(product);
    }
    doubles(v, out, "gt32", greater);
    doubles(v, out, "add32", sum);
    doubles(v, out, "sar32_by", shifted);
    doubles(v, out, "pick32", picked);
    doubles(v, out, "add32_rounded", rounded);
    doubles(v, out, "to_whole", single);
    results! { halves v, out;
        words narrow_mask32(greater);
        words narrow_rounded(halved; n);
    }
}

#[test]
fn every_operation_gives_the_portable_result() {
    let mut random = SplitMix64::seed_from_u64(1);
    for _ in 0..200 {
        let inputs = Inputs::new(&mut random);
        let mut expected = Outputs::new();
        operate(Backend::PORTABLE, &inputs, &mut expected);
        for backend in Backend::available() {
            let mut found = Outputs::new();
            operate(backend, &inputs, &mut found);
            for (operation, expected) in &expected {
                let found = &found[operation];
                assert_eq!(expected, found, "{operation} of {}", backend.name());
            }
        }
    }
}
