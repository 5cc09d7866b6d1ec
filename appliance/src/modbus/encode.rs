//! From values to the 16-bit words of registers. Which value a register has is in the table of
//! [`super::map`].

use crate::config::WordOrder;
use crate::station::{Decision, GaugeValue, ResultRecord};

/// `i32` of a missing value.
pub const INVALID_I32: u32 = 0x8000_0000;
/// `f32` of a missing value.
pub const INVALID_F32: u32 = 0x7FC0_0000;
/// Unknown temperature.
pub const UNKNOWN_I16: u16 = 0x8000;
/// Unknown load, memory or storage.
pub const UNKNOWN_U16: u16 = 0xFFFF;
/// "FRNG".
pub const MAGIC: u32 = 0x4652_4E47;

/// Registers of a text of 32 characters.
pub(super) const TEXT: u16 = 16;

/// The words of one block, addressed as in the map.
pub(super) struct Words {
    pub(super) first: u16,
    pub(super) words: Vec<u16>,
    pub(super) order: WordOrder,
}

impl Words {
    /// Puts the value of a row at its address.
    pub(super) fn put(&mut self, address: u16, value: impl Item) {
        value.put(self, address);
    }

    /// Puts the halves of a value, in the order of words that is set.
    fn put_halves<T: Item>(&mut self, address: u16, high: T, low: T) {
        let halves = match self.order {
            WordOrder::Normal => [high, low],
            WordOrder::Swapped => [low, high],
        };
        self.put(address, halves);
    }
}

/// A value of one or more registers.
pub(super) trait Item {
    /// How many registers.
    const WIDTH: u16;

    fn put(self, words: &mut Words, address: u16);
}

impl Item for u16 {
    const WIDTH: u16 = 1;

    fn put(self, words: &mut Words, address: u16) {
        // Every address comes from the table, whose rows lie inside their block (tested there).
        if let Some(place) = address
            .checked_sub(words.first)
            .and_then(|k| words.words.get_mut(usize::from(k)))
        {
            *place = self;
        }
    }
}

impl Item for u32 {
    const WIDTH: u16 = 2;

    fn put(self, words: &mut Words, address: u16) {
        words.put_halves(address, (self >> 16) as u16, self as u16);
    }
}

impl Item for u64 {
    const WIDTH: u16 = 4;

    fn put(self, words: &mut Words, address: u16) {
        words.put_halves(address, (self >> 32) as u32, self as u32);
    }
}

impl<T: Item, const N: usize> Item for [T; N] {
    const WIDTH: u16 = T::WIDTH * N as u16;

    fn put(self, words: &mut Words, address: u16) {
        for (address, item) in (address..).step_by(T::WIDTH.into()).zip(self) {
            words.put(address, item);
        }
    }
}

impl Item for &[u8] {
    const WIDTH: u16 = TEXT;

    fn put(self, words: &mut Words, address: u16) {
        let pairs = self.chunks(2);
        for (address, pair) in (address..).zip(pairs) {
            let byte = |k| u16::from(pair.get(k).copied().unwrap_or(0));
            words.put(address, byte(0) << 8 | byte(1));
        }
    }
}

impl Item for &str {
    const WIDTH: u16 = TEXT;

    /// At most 32 characters, NUL padded; characters that are not ASCII become `?`.
    fn put(self, words: &mut Words, address: u16) {
        let ascii: Vec<u8> = self
            .chars()
            .take(2 * usize::from(TEXT))
            .map(|c| u8::try_from(c).ok().filter(u8::is_ascii).unwrap_or(b'?'))
            .collect();
        words.put(address, &*ascii);
    }
}

/// The item of the gauge in each of the first `N` slots, and `empty` in slots without a gauge.
pub(super) fn slots<'r, T: Copy, const N: usize>(
    record: &'r ResultRecord,
    empty: T,
    item: impl Fn(&'r GaugeValue) -> T,
) -> [T; N] {
    let mut items = [empty; N];
    for gauge in &record.inspection.gauges {
        let place = usize::from(gauge.slot).checked_sub(1);
        if let Some(own) = place.and_then(|place| items.get_mut(place)) {
            *own = item(gauge);
        }
    }
    items
}

/// The highest occupied of the slots up to `most`; 0 if none is.
pub(super) fn last_slot(record: &ResultRecord, most: u16) -> u16 {
    let occupied = record.inspection.gauges.iter().map(|gauge| gauge.slot);
    occupied.filter(|slot| *slot <= most).max().unwrap_or(0)
}

/// The bits of the slots for which `set` is true: slot s is bit (s − 1) mod 16 of word (s − 1) / 16.
pub(super) fn bits(record: &ResultRecord, set: impl Fn(&Decision) -> bool) -> [u16; 4] {
    let all: [u16; 64] = slots(record, 0, |gauge| set(&gauge.decision).into());
    let mut words = [0; 4];
    for (word, bits) in words.iter_mut().zip(all.chunks(16)) {
        *word = bits.iter().rev().fold(0, |word, bit| word << 1 | bit);
    }
    words
}

/// The bits of the first 16 slots for which `set` is true: slot s is bit s − 1.
pub(super) fn mask(record: &ResultRecord, set: impl Fn(&Decision) -> bool) -> u32 {
    let [first, ..] = bits(record, set);
    first.into()
}

/// The value of each slot in its unit's steps.
pub(super) fn steps<const N: usize>(record: &ResultRecord) -> [u32; N] {
    slots(record, INVALID_I32, |gauge| {
        i32_steps(measured(gauge, gauge.value), gauge.unit.steps())
    })
}

/// A number of each slot as `f32`.
pub(super) fn floats<const N: usize>(
    record: &ResultRecord,
    number: impl Fn(&GaugeValue) -> Option<f64>,
) -> [u32; N] {
    slots(record, INVALID_F32, |gauge| f32_bits(number(gauge)))
}

/// A number of a gauge, only if the gauge is valid: a number beside VALID = 0 would be taken for a
/// measurement.
pub(super) fn measured(gauge: &GaugeValue, number: Option<f64>) -> Option<f64> {
    number.filter(|_| gauge.decision.valid)
}

/// The bits of the stored recipes that the directory has room for.
pub(super) fn stored(recipes: &[u16]) -> [u16; 64] {
    let mut words = [0; 64];
    for recipe in recipes {
        let bit = recipe.wrapping_sub(1);
        if let Some(word) = words.get_mut(usize::from(bit / 16)) {
            *word |= 1 << (bit % 16);
        }
    }
    words
}

/// A number, saturated below the value that means "not known".
pub(super) fn known(value: Option<u64>) -> u16 {
    let most = UNKNOWN_U16 - 1;
    value.map_or(UNKNOWN_U16, |value| {
        u16::try_from(value).unwrap_or(most).min(most)
    })
}

/// A value in register steps, to nearest; saturates at ±(2³¹ − 1), 0x80000000 if there is none.
pub fn i32_steps(value: Option<f64>, steps: f64) -> u32 {
    let Some(value) = value.filter(|value| !value.is_nan()) else {
        return INVALID_I32;
    };
    let limit = f64::from(i32::MAX);
    // The cast is exact: the value is whole and inside the range.
    let whole = (value * steps).round().clamp(-limit, limit) as i32;
    u32::from_be_bytes(whole.to_be_bytes())
}

/// A value as the bits of an `f32`; the one quiet NaN if there is none.
pub fn f32_bits(value: Option<f64>) -> u32 {
    value
        .filter(|value| !value.is_nan())
        .map_or(INVALID_F32, |value| (value as f32).to_bits())
}

pub(super) fn tenths(celsius: Option<f64>) -> u16 {
    celsius
        .filter(|value| value.is_finite())
        .map_or(UNKNOWN_I16, |value| {
            let whole = (value * 10.0).round().clamp(-32_767.0, 32_767.0) as i16;
            u16::from_be_bytes(whole.to_be_bytes())
        })
}

pub(super) fn saturated_u16(value: f64) -> u16 {
    // The cast turns NaN into 0 and saturates everything else.
    value.round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_saturate_and_missing_ones_are_invalid() {
        assert_eq!(i32_steps(Some(0.12346), 10_000.0), 1235);
        assert_eq!(i32_steps(Some(-0.1), 10_000.0), (-1000_i32).cast_unsigned());
        assert_eq!(i32_steps(Some(1e9), 10_000.0), 0x7FFF_FFFF);
        assert_eq!(i32_steps(Some(-1e9), 10_000.0), 0x8000_0001);
        assert_eq!(i32_steps(Some(f64::NAN), 10_000.0), 0x8000_0000);
        assert_eq!(i32_steps(None, 10_000.0), 0x8000_0000);
        assert_eq!(f32_bits(Some(-f64::NAN)), 0x7FC0_0000);
        assert_eq!(f32_bits(Some(0.5)), 0x3F00_0000);
        assert_eq!(
            (tenths(Some(-3.26)), tenths(None)),
            ((-33_i16).cast_unsigned(), 0x8000)
        );
        assert_eq!(
            (saturated_u16(1e9), saturated_u16(-1.0), saturated_u16(12.5)),
            (65_535, 0, 13)
        );
    }
}
