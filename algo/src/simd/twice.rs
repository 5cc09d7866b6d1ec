//! Two neighbouring blocks at a time.
//!
//! Demodulation is a chain of some forty dependent operations; a processor that looks ahead a few hundred instructions sees
//! little more than one block of them. Two chains side by side keep it busy, and share every constant that is loaded.

use super::lanes::{Lanes, Scaled};
use super::rows::Four;

/// A back-end's blocks in pairs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twice<V>(pub V);

impl<V: Lanes> Lanes for Twice<V> {
    const PIXELS: usize = 2 * V::PIXELS;
    type B = [V::B; 2];
    type W = [V::W; 2];
    type D = [V::D; 2];
    type F = [V::F; 2];
    type Count = V::Count;

    #[inline(always)]
    fn splat8(self, x: u8) -> Self::B {
        [self.0.splat8(x), self.0.splat8(x)]
    }
    #[inline(always)]
    fn load8(self, from: &[u8], at: usize) -> Self::B {
        [self.0.load8(from, at), self.0.load8(from, at + V::PIXELS)]
    }
    #[inline(always)]
    fn load8_of_four(self, from: &Four<'_, u8>, at: usize) -> [Self::B; 4] {
        let (first, second) = (
            self.0.load8_of_four(from, at),
            self.0.load8_of_four(from, at + V::PIXELS),
        );
        [
            [first[0], second[0]],
            [first[1], second[1]],
            [first[2], second[2]],
            [first[3], second[3]],
        ]
    }
    #[inline(always)]
    fn fetch_ahead<T>(self, from: &Four<'_, T>, at: usize) {
        self.0.fetch_ahead(from, at);
    }
    #[inline(always)]
    fn store8(self, to: &mut [u8], at: usize, x: Self::B) {
        self.0.store8(to, at, x[0]);
        self.0.store8(to, at + V::PIXELS, x[1]);
    }
    #[inline(always)]
    fn min8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.min8(a[0], b[0]), self.0.min8(a[1], b[1])]
    }
    #[inline(always)]
    fn max8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.max8(a[0], b[0]), self.0.max8(a[1], b[1])]
    }
    #[inline(always)]
    fn sub8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.sub8(a[0], b[0]), self.0.sub8(a[1], b[1])]
    }
    #[inline(always)]
    fn eq8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.eq8(a[0], b[0]), self.0.eq8(a[1], b[1])]
    }
    #[inline(always)]
    fn and8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.and8(a[0], b[0]), self.0.and8(a[1], b[1])]
    }
    #[inline(always)]
    fn or8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.or8(a[0], b[0]), self.0.or8(a[1], b[1])]
    }
    #[inline(always)]
    fn xor8(self, a: Self::B, b: Self::B) -> Self::B {
        [self.0.xor8(a[0], b[0]), self.0.xor8(a[1], b[1])]
    }
    #[inline(always)]
    fn pick8(self, mask: Self::B, a: Self::B, b: Self::B) -> Self::B {
        [
            self.0.pick8(mask[0], a[0], b[0]),
            self.0.pick8(mask[1], a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn quarters8(self, half: Self::B, quarter: Self::B) -> Self::B {
        [
            self.0.quarters8(half[0], quarter[0]),
            self.0.quarters8(half[1], quarter[1]),
        ]
    }
    #[inline(always)]
    fn by_excess(self, table: &[u8; 16], x: Self::B) -> Self::B {
        [self.0.by_excess(table, x[0]), self.0.by_excess(table, x[1])]
    }
    #[inline(always)]
    fn all8(self, mask: Self::B) -> bool {
        self.0.all8(self.0.and8(mask[0], mask[1]))
    }
    #[inline(always)]
    fn none8(self, mask: Self::B) -> bool {
        self.0.none8(self.0.or8(mask[0], mask[1]))
    }
    #[inline(always)]
    fn widen(self, low: Self::B, high: Self::B) -> [Self::W; 2] {
        let (first, second) = (self.0.widen(low[0], high[0]), self.0.widen(low[1], high[1]));
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn signs(self, mask: Self::B) -> [Self::W; 2] {
        let (first, second) = (self.0.signs(mask[0]), self.0.signs(mask[1]));
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn widen_256(self, x: Self::B) -> [Self::W; 2] {
        let (first, second) = (self.0.widen_256(x[0]), self.0.widen_256(x[1]));
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn widen_128(self, x: Self::B) -> [Self::W; 2] {
        let (first, second) = (self.0.widen_128(x[0]), self.0.widen_128(x[1]));
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn scaled(self, long: Self::B, short: Self::B) -> Scaled<Self::W> {
        let (first, second) = (
            self.0.scaled(long[0], short[0]),
            self.0.scaled(long[1], short[1]),
        );
        Scaled {
            long: [[first.long[0], second.long[0]], [first.long[1], second.long[1]]],
            short: [[first.short[0], second.short[0]], [first.short[1], second.short[1]]],
            centred: [
                [first.centred[0], second.centred[0]],
                [first.centred[1], second.centred[1]],
            ],
        }
    }
    #[inline(always)]
    fn narrow_mask(self, mask: [Self::W; 2]) -> Self::B {
        [
            self.0.narrow_mask([mask[0][0], mask[1][0]]),
            self.0.narrow_mask([mask[0][1], mask[1][1]]),
        ]
    }
    #[inline(always)]
    fn splat16(self, x: i16) -> Self::W {
        [self.0.splat16(x), self.0.splat16(x)]
    }
    #[inline(always)]
    fn load16(self, from: &[u16], at: usize) -> [Self::W; 2] {
        let (first, second) = (self.0.load16(from, at), self.0.load16(from, at + V::PIXELS));
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn store16(self, to: &mut [u16], at: usize, x: [Self::W; 2]) {
        self.0.store16(to, at, [x[0][0], x[1][0]]);
        self.0.store16(to, at + V::PIXELS, [x[0][1], x[1][1]]);
    }
    #[inline(always)]
    fn add(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.add(a[0], b[0]), self.0.add(a[1], b[1])]
    }
    #[inline(always)]
    fn sub(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.sub(a[0], b[0]), self.0.sub(a[1], b[1])]
    }
    #[inline(always)]
    fn add_signed(self, a: Self::W, b: Self::W, sign: Self::W) -> Self::W {
        [
            self.0.add_signed(a[0], b[0], sign[0]),
            self.0.add_signed(a[1], b[1], sign[1]),
        ]
    }
    #[inline(always)]
    fn add_sat(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.add_sat(a[0], b[0]), self.0.add_sat(a[1], b[1])]
    }
    #[inline(always)]
    fn mul_q15(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.mul_q15(a[0], b[0]), self.0.mul_q15(a[1], b[1])]
    }
    #[inline(always)]
    fn mul_low(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.mul_low(a[0], b[0]), self.0.mul_low(a[1], b[1])]
    }
    #[inline(always)]
    fn shl<const N: i32>(self, x: Self::W) -> Self::W {
        [self.0.shl::<N>(x[0]), self.0.shl::<N>(x[1])]
    }
    #[inline(always)]
    fn sar<const N: i32>(self, x: Self::W) -> Self::W {
        [self.0.sar::<N>(x[0]), self.0.sar::<N>(x[1])]
    }
    #[inline(always)]
    fn left(self, n: u8) -> Self::Count {
        self.0.left(n)
    }
    #[inline(always)]
    fn right(self, n: u8) -> Self::Count {
        self.0.right(n)
    }
    #[inline(always)]
    fn shl_by(self, x: Self::W, n: Self::Count) -> Self::W {
        [self.0.shl_by(x[0], n), self.0.shl_by(x[1], n)]
    }
    #[inline(always)]
    fn sar_by(self, x: Self::W, n: Self::Count) -> Self::W {
        [self.0.sar_by(x[0], n), self.0.sar_by(x[1], n)]
    }
    #[inline(always)]
    fn shr_by(self, x: Self::W, n: Self::Count) -> Self::W {
        [self.0.shr_by(x[0], n), self.0.shr_by(x[1], n)]
    }
    #[inline(always)]
    fn halve(self, x: Self::W) -> Self::W {
        [self.0.halve(x[0]), self.0.halve(x[1])]
    }
    #[inline(always)]
    fn abs(self, x: Self::W) -> Self::W {
        [self.0.abs(x[0]), self.0.abs(x[1])]
    }
    #[inline(always)]
    fn min(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.min(a[0], b[0]), self.0.min(a[1], b[1])]
    }
    #[inline(always)]
    fn max(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.max(a[0], b[0]), self.0.max(a[1], b[1])]
    }
    #[inline(always)]
    fn max_unsigned(self, a: Self::W, b: Self::W) -> Self::W {
        [
            self.0.max_unsigned(a[0], b[0]),
            self.0.max_unsigned(a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn gt(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.gt(a[0], b[0]), self.0.gt(a[1], b[1])]
    }
    #[inline(always)]
    fn eq(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.eq(a[0], b[0]), self.0.eq(a[1], b[1])]
    }
    #[inline(always)]
    fn and(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.and(a[0], b[0]), self.0.and(a[1], b[1])]
    }
    #[inline(always)]
    fn or(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.or(a[0], b[0]), self.0.or(a[1], b[1])]
    }
    #[inline(always)]
    fn xor(self, a: Self::W, b: Self::W) -> Self::W {
        [self.0.xor(a[0], b[0]), self.0.xor(a[1], b[1])]
    }
    #[inline(always)]
    fn pick(self, mask: Self::W, a: Self::W, b: Self::W) -> Self::W {
        [
            self.0.pick(mask[0], a[0], b[0]),
            self.0.pick(mask[1], a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn join(self, low: Self::W, high: Self::W) -> [Self::D; 2] {
        let (first, second) = (self.0.join(low[0], high[0]), self.0.join(low[1], high[1]));
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn split(self, x: [Self::D; 2]) -> (Self::W, Self::W) {
        let (first, second) = (
            self.0.split([x[0][0], x[1][0]]),
            self.0.split([x[0][1], x[1][1]]),
        );
        ([first.0, second.0], [first.1, second.1])
    }
    #[inline(always)]
    fn dot(self, a: Self::W, b: Self::W, c: Self::W, d: Self::W) -> [Self::D; 2] {
        let (first, second) = (
            self.0.dot(a[0], b[0], c[0], d[0]),
            self.0.dot(a[1], b[1], c[1], d[1]),
        );
        [[first[0], second[0]], [first[1], second[1]]]
    }
    #[inline(always)]
    fn narrow_rounded(self, x: [Self::D; 2], n: u8) -> Self::W {
        [
            self.0.narrow_rounded([x[0][0], x[1][0]], n),
            self.0.narrow_rounded([x[0][1], x[1][1]], n),
        ]
    }
    #[inline(always)]
    fn narrow_mask32(self, mask: [Self::D; 2]) -> Self::W {
        [
            self.0.narrow_mask32([mask[0][0], mask[1][0]]),
            self.0.narrow_mask32([mask[0][1], mask[1][1]]),
        ]
    }
    #[inline(always)]
    fn splat32(self, x: i32) -> Self::D {
        [self.0.splat32(x), self.0.splat32(x)]
    }
    #[inline(always)]
    fn load32(self, from: &[i32], at: usize) -> [[Self::D; 2]; 2] {
        let (first, second) = (self.0.load32(from, at), self.0.load32(from, at + V::PIXELS));
        [
            [[first[0][0], second[0][0]], [first[0][1], second[0][1]]],
            [[first[1][0], second[1][0]], [first[1][1], second[1][1]]],
        ]
    }
    #[inline(always)]
    fn store32(self, to: &mut [i32], at: usize, x: [[Self::D; 2]; 2]) {
        self.0
            .store32(to, at, [[x[0][0][0], x[0][1][0]], [x[1][0][0], x[1][1][0]]]);
        self.0.store32(
            to,
            at + V::PIXELS,
            [[x[0][0][1], x[0][1][1]], [x[1][0][1], x[1][1][1]]],
        );
    }
    #[inline(always)]
    fn add32(self, a: Self::D, b: Self::D) -> Self::D {
        [self.0.add32(a[0], b[0]), self.0.add32(a[1], b[1])]
    }
    #[inline(always)]
    fn sub32(self, a: Self::D, b: Self::D) -> Self::D {
        [self.0.sub32(a[0], b[0]), self.0.sub32(a[1], b[1])]
    }
    #[inline(always)]
    fn sar32_by(self, x: Self::D, n: u8) -> Self::D {
        [self.0.sar32_by(x[0], n), self.0.sar32_by(x[1], n)]
    }
    #[inline(always)]
    fn gt32(self, a: Self::D, b: Self::D) -> Self::D {
        [self.0.gt32(a[0], b[0]), self.0.gt32(a[1], b[1])]
    }
    #[inline(always)]
    fn eq32(self, a: Self::D, b: Self::D) -> Self::D {
        [self.0.eq32(a[0], b[0]), self.0.eq32(a[1], b[1])]
    }
    #[inline(always)]
    fn pick32(self, mask: Self::D, a: Self::D, b: Self::D) -> Self::D {
        [
            self.0.pick32(mask[0], a[0], b[0]),
            self.0.pick32(mask[1], a[1], b[1]),
        ]
    }
    #[inline(always)]
    fn to_single(self, x: Self::D) -> Self::F {
        [self.0.to_single(x[0]), self.0.to_single(x[1])]
    }
    #[inline(always)]
    fn to_whole(self, x: Self::F) -> Self::D {
        [self.0.to_whole(x[0]), self.0.to_whole(x[1])]
    }
    #[inline(always)]
    fn bits(self, x: Self::F) -> Self::D {
        [self.0.bits(x[0]), self.0.bits(x[1])]
    }
    #[inline(always)]
    fn with_bits(self, x: Self::D) -> Self::F {
        [self.0.with_bits(x[0]), self.0.with_bits(x[1])]
    }
    #[inline(always)]
    fn splat_single(self, x: f32) -> Self::F {
        [self.0.splat_single(x), self.0.splat_single(x)]
    }
    #[inline(always)]
    fn add_single(self, a: Self::F, b: Self::F) -> Self::F {
        [self.0.add_single(a[0], b[0]), self.0.add_single(a[1], b[1])]
    }
    #[inline(always)]
    fn sub_single(self, a: Self::F, b: Self::F) -> Self::F {
        [self.0.sub_single(a[0], b[0]), self.0.sub_single(a[1], b[1])]
    }
    #[inline(always)]
    fn mul_single(self, a: Self::F, b: Self::F) -> Self::F {
        [self.0.mul_single(a[0], b[0]), self.0.mul_single(a[1], b[1])]
    }
    #[inline(always)]
    fn lt_single(self, a: Self::F, b: Self::F) -> Self::D {
        [self.0.lt_single(a[0], b[0]), self.0.lt_single(a[1], b[1])]
    }
}
