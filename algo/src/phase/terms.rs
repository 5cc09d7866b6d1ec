//! The samples of a block → S and C, for each number of shifts from 3 to 9, and by weights for any
//! other.
//!
//! **Idea.** Shifts half a turn apart have weights of opposite sign, shifts k and N − k have
//! mirrored ones. So S and C are sums of a few differences of samples, of half as many products or
//! fewer, and the offset A drops out of every difference exactly.
//!
//! **Equation.** S = Σ I_k cos 2πk/N and C = Σ I_k sin 2πk/N ([`super::fold`]) become
//!
//! ```text
//! even N, D_k = I_k − I_{k+N/2}     S = D_0 + Σ cos(2πk/N) (D_k − D_{N/2−k})               0 < k < N/4
//!                                   C = D_{N/4} + Σ sin(2πk/N) (D_k + D_{N/2−k})           D_{N/4} only where 4 divides N
//! odd N                             S = Σ −cos(2πk/N) (2I_0 − I_k − I_{N−k})               0 < k < N/2; Σ cos = −1/2
//!                                   C = Σ sin(2πk/N) (I_k − I_{N−k})
//! ```
//!
//! | N | terms of S, C | arithmetic, up to 12 bits |
//! |---|---|---|
//! | 4 | 1, 1 | exact (8 bits: in bytes, [`super::fold`]) |
//! | 3, 6 | 1, 1; 2, 1 | words: S exact, C = (√3/2) · difference with one rounding |
//! | 5, 8, 7, 9 | 2, 2; 2, 2; 3, 3; 4, 4 | products in 32 bits, rounded to words once |
//!
//! Any other N, shifts that do not start on the grid of k/N, and samples of more than 12 bits
//! (whose differences do not fit words) are summed with weights: S = Σ w_k (I_k − middle), C
//! likewise, in 32 bits, rounded to words once. The weights of S add up to 0, and so do those of C.
//! N = 4 of more than 12 bits is S = (I_0 − I_2)/4, rounded, from two means.
//!
//! **Shapes and units.** One block of each row. S and C are words of at most 32,700, in the unit
//! that [`super::level`] chooses.
//!
//! **Accuracy.** S and C are within half a unit, and the rounded weights of N = 5, 7, 8 and 9 turn
//! the pointer by less than 3e-7 turn. Phase and modulation of every N at every depth:
//! `every_number_of_shifts_is_within_the_bounds` and
//! `any_number_of_steps_at_any_depth_agrees_with_the_definition`.

use super::clipped::Pixels;
use super::level::{Demodulation, LevelLanes};
use super::samples::BlockSample;
use crate::simd::{Lanes, MAX_PIXELS, Rows};

/// The pointers of a block.
pub(super) struct Pointers<V: Lanes> {
    pub s: [V::W; 2],
    pub c: [V::W; 2],
    /// 255 where a sample is at full scale, as long as the phase is not found without it.
    pub brightest: V::B,
}

/// S and C of the block at `at`, from the rows of the level's frames.
#[inline(always)]
pub(super) fn pointers<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    rows: &Rows<'_, T>,
    at: usize,
) -> Pointers<V> {
    if level.plan.demodulation != Demodulation::Weighted {
        match rows.count() {
            3 => return of_shifts::<V, T, 3>(v, level, &blocks(v, &rows.all(), at)),
            4 => return of_shifts::<V, T, 4>(v, level, &blocks(v, &rows.all(), at)),
            5 => return of_shifts::<V, T, 5>(v, level, &blocks(v, &rows.all(), at)),
            6 => return of_shifts::<V, T, 6>(v, level, &blocks(v, &rows.all(), at)),
            7 => return of_shifts::<V, T, 7>(v, level, &blocks(v, &rows.all(), at)),
            8 => return of_shifts::<V, T, 8>(v, level, &blocks(v, &rows.all(), at)),
            9 => return of_shifts::<V, T, 9>(v, level, &blocks(v, &rows.all(), at)),
            _ => {}
        }
    }
    weighted(v, level, rows, at)
}

/// The blocks of N rows at `at`.
#[inline(always)]
pub(super) fn blocks<V: Lanes, T: BlockSample, const N: usize>(
    v: V,
    rows: &[&[T]; N],
    at: usize,
) -> [T::Block<V>; N] {
    let mut blocks = [T::load(v, rows[0], at); N];
    let mut k = 0;
    while k < N {
        v.fetch(rows[k], at, V::AHEAD);
        blocks[k] = T::load(v, rows[k], at);
        k += 1;
    }
    blocks
}

/// N shifts that start at 0.
#[inline(always)]
pub(super) fn of_shifts<V: Lanes, T: BlockSample, const N: usize>(
    v: V,
    level: &LevelLanes<'_, V>,
    blocks: &[T::Block<V>; N],
) -> Pointers<V> {
    let mut brightest = blocks[0];
    let mut k = 1;
    while k < N {
        brightest = T::brighter(v, brightest, blocks[k]);
        k += 1;
    }
    let [s, c] = match N {
        3 | 6 => thirds::<V, T, N>(v, level, blocks),
        4 => [
            four::<V, T>(v, level, blocks[0], blocks[N / 2]),
            four::<V, T>(v, level, blocks[1], blocks[N - 1]),
        ],
        _ => {
            let [along, across] = terms::<V, T, N>(v, blocks);
            let four = N == 7 || N == 9;
            [
                products::<V, T>(v, level, &along, level.terms[0], four),
                products::<V, T>(v, level, &across, level.terms[1], four),
            ]
        }
    };
    Pointers {
        s,
        c,
        brightest: T::saturated(v, level, brightest),
    }
}

impl<V: Lanes> Pointers<V> {
    /// With those of pixels that have clipped samples found from the others, where there are such
    /// pixels. `row(k)` are the samples of shift k.
    #[inline(always)]
    pub fn mended<'a, T: BlockSample + 'a>(
        self,
        v: V,
        level: &LevelLanes<'_, V>,
        row: impl Fn(usize) -> &'a [T],
        at: usize,
    ) -> Self {
        let clipped = v.eq8(self.brightest, v.splat8(u8::MAX));
        let (false, Some(plan)) = (v.none8(clipped), &level.plan.clipped) else {
            return self;
        };
        let mut pixels = Pixels {
            s: [0; MAX_PIXELS],
            c: [0; MAX_PIXELS],
            brightest: [0; MAX_PIXELS],
        };
        v.store16(&mut pixels.s, 0, self.s);
        v.store16(&mut pixels.c, 0, self.c);
        v.store8(&mut pixels.brightest, 0, self.brightest);
        plan.mend(row, at, &mut pixels, V::PIXELS);
        Self {
            s: v.load16(&pixels.s, 0),
            c: v.load16(&pixels.c, 0),
            brightest: v.load8(&pixels.brightest, 0),
        }
    }
}

/// N = 4: a difference, moved up to fill a word; of more than 12 bits, a quarter of it at 16 bits.
#[inline(always)]
fn four<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    a: T::Block<V>,
    b: T::Block<V>,
) -> [V::W; 2] {
    if level.plan.demodulation != Demodulation::WideFour {
        let [_, lift] = T::lift::<V, 4>(v, level);
        return up(v, T::difference(v, a, b), lift);
    }
    let middle = v.splat16(i16::MIN);
    let (a, b) = (T::centred(v, level, a), T::centred(v, level, b));
    let mut quarter = a;
    let mut half = 0;
    while half < 2 {
        // The mean of unsigned a and 65535 − b is (a − b)/2 + 32768; the mean of that and 32768 has
        // half of the difference.
        let mean = v.mean(v.xor(a[half], middle), v.xor(b[half], v.splat16(i16::MAX)));
        quarter[half] = v.xor(v.mean(mean, middle), middle);
        half += 1;
    }
    quarter
}

/// √3/2 in Q15.
const ROOT_3_HALVES: i16 = 28_378;

/// N = 3 and 6: 2S and 2C/√3 are sums of samples.
#[inline(always)]
fn thirds<V: Lanes, T: BlockSample, const N: usize>(
    v: V,
    level: &LevelLanes<'_, V>,
    blocks: &[T::Block<V>; N],
) -> [[V::W; 2]; 2] {
    let [along, across] = terms::<V, T, N>(v, blocks);
    let along = match N {
        3 => along[0],
        _ => add(v, add(v, along[0], along[0]), along[1]),
    };
    let [half_lift, lift] = T::lift::<V, N>(v, level);
    let across = up(v, across[0], lift);
    let root = v.splat16(ROOT_3_HALVES);
    [
        up(v, along, half_lift),
        [v.mul_q15(across[0], root), v.mul_q15(across[1], root)],
    ]
}

/// The terms of S and of C, in the order of the equations; 0 where there are fewer than four.
#[inline(always)]
fn terms<V: Lanes, T: BlockSample, const N: usize>(
    v: V,
    blocks: &[T::Block<V>; N],
) -> [[[V::W; 2]; 4]; 2] {
    let mut terms = [[[v.splat16(0); 2]; 4]; 2];
    let [along, across] = &mut terms;
    let half = N / 2;
    let mut k = 1;
    if N.is_multiple_of(2) {
        along[0] = T::difference(v, blocks[0], blocks[half]);
        let middle = half / 2;
        let middle_terms = if half.is_multiple_of(2) { 1 } else { 0 };
        if middle_terms == 1 {
            across[0] = T::difference(v, blocks[middle], blocks[middle + half]);
        }
        while 2 * k < half {
            let a = T::difference(v, blocks[k], blocks[k + half]);
            let b = T::difference(v, blocks[half - k], blocks[N - k]);
            along[k] = sub(v, a, b);
            across[k - 1 + middle_terms] = add(v, a, b);
            k += 1;
        }
    } else {
        let twice = T::sum(v, blocks[0], blocks[0]);
        while k <= half {
            let (a, b) = (blocks[k], blocks[N - k]);
            along[k - 1] = sub(v, twice, T::sum(v, a, b));
            across[k - 1] = T::difference(v, a, b);
            k += 1;
        }
    }
    terms
}

/// Two or four terms times their weights, in pairs, rounded to words once.
#[inline(always)]
fn products<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    terms: &[[V::W; 2]; 4],
    weights: [V::D; 2],
    four: bool,
) -> [V::W; 2] {
    let mut words = terms[0];
    let mut half = 0;
    while half < 2 {
        let mut sum = v.dot_pair(terms[0][half], terms[1][half], weights[0]);
        if four {
            let more = v.dot_pair(terms[2][half], terms[3][half], weights[1]);
            sum = add32(v, sum, more);
        }
        words[half] = T::rounded(v, level, sum);
        half += 1;
    }
    words
}

/// Any N, with a weight for every sample.
#[inline(always)]
fn weighted<V: Lanes, T: BlockSample>(
    v: V,
    level: &LevelLanes<'_, V>,
    rows: &Rows<'_, T>,
    at: usize,
) -> Pointers<V> {
    let zero = v.splat32(0);
    let mut s = [[zero; 2]; 2];
    let mut c = [[zero; 2]; 2];
    let mut brightest = T::load(v, rows.row(0), at);
    // Two rows at a time: one instruction multiplies and adds two pairs of words. The last weight
    // of an odd N is 0.
    for (pair, &[along, across]) in level.plan.weights.iter().enumerate() {
        let (first, second) = (
            rows.row(2 * pair),
            rows.row((2 * pair + 1).min(rows.count() - 1)),
        );
        v.fetch(first, at, V::AHEAD);
        v.fetch(second, at, V::AHEAD);
        let (first, second) = (T::load(v, first, at), T::load(v, second, at));
        brightest = T::brighter(v, brightest, T::brighter(v, first, second));
        let [first, second] = if level.plan.to_16_bits == 0 {
            [T::centred_16(v, first), T::centred_16(v, second)]
        } else {
            [T::centred(v, level, first), T::centred(v, level, second)]
        };
        let (along, across) = (v.splat32(along), v.splat32(across));
        let mut half = 0;
        while half < 2 {
            s[half] = add32(v, s[half], v.dot_pair(first[half], second[half], along));
            c[half] = add32(v, c[half], v.dot_pair(first[half], second[half], across));
            half += 1;
        }
    }
    Pointers {
        s: rounded_sums(v, s),
        c: rounded_sums(v, c),
        brightest: T::saturated(v, level, brightest),
    }
}

#[inline(always)]
fn rounded_sums<V: Lanes>(v: V, [low, high]: [[V::D; 2]; 2]) -> [V::W; 2] {
    [
        v.narrow_rounded_by::<16>(low),
        v.narrow_rounded_by::<16>(high),
    ]
}

#[inline(always)]
fn add<V: Lanes>(v: V, a: [V::W; 2], b: [V::W; 2]) -> [V::W; 2] {
    [v.add(a[0], b[0]), v.add(a[1], b[1])]
}

#[inline(always)]
fn sub<V: Lanes>(v: V, a: [V::W; 2], b: [V::W; 2]) -> [V::W; 2] {
    [v.sub(a[0], b[0]), v.sub(a[1], b[1])]
}

#[inline(always)]
fn up<V: Lanes>(v: V, x: [V::W; 2], bits: V::Count) -> [V::W; 2] {
    [v.shl_by(x[0], bits), v.shl_by(x[1], bits)]
}

#[inline(always)]
fn add32<V: Lanes>(v: V, a: [V::D; 2], b: [V::D; 2]) -> [V::D; 2] {
    [v.add32(a[0], b[0]), v.add32(a[1], b[1])]
}
