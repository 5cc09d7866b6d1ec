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
    fn put(self, words: &mut Words, address: u16);
}

impl Item for u16 {
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
    fn put(self, words: &mut Words, address: u16) {
        words.put_halves(address, (self >> 16) as u16, self as u16);
    }
}

impl Item for u64 {
    fn put(self, words: &mut Words, address: u16) {
        words.put_halves(address, (self >> 32) as u32, self as u32);
    }
}

impl<T: Item, const N: usize> Item for [T; N] {
    fn put(self, words: &mut Words, address: u16) {
        for (address, item) in (address..).step_by(size_of::<T>() / 2).zip(self) {
            words.put(address, item);
        }
    }
}

impl Item for &[u8] {
    fn put(self, words: &mut Words, address: u16) {
        let pairs = self.chunks(2);
        for (address, pair) in (address..).zip(pairs) {
            let byte = |k| u16::from(pair.get(k).copied().unwrap_or(0));
            words.put(address, byte(0) << 8 | byte(1));
        }
    }
}

impl Item for &str {
    /// At most 32 characters, NUL padded; characters that are not ASCII become `?`.
    fn put(self, words: &mut Words, address: u16) {
        let ascii: Vec<u8> = self
            .chars()
            .take(32)
            .map(|c| u8::try_from(c).ok().filter(u8::is_ascii).unwrap_or(b'?'))
            .collect();
        words.put(address, &*ascii);
    }
}

/// Gauges that the blocks of results have room for.
const GAUGES: usize = 16;

/// The item of each gauge of a result, and `missing` where there is no gauge.
pub(super) fn gauges<T: Copy>(
    record: &ResultRecord,
    missing: T,
    item: impl Fn(&GaugeValue) -> T,
) -> [T; GAUGES] {
    let gauges = &record.inspection.gauges;
    std::array::from_fn(|k| gauges.get(k).map_or(missing, &item))
}

/// The bits of the gauges for which `set` is true: gauge k is bit k.
pub(super) fn mask(record: &ResultRecord, set: impl Fn(&Decision) -> bool) -> u32 {
    let bits = gauges(record, 0, |gauge| u32::from(set(&gauge.decision)));
    bits.iter().rev().fold(0, |mask, bit| mask << 1 | bit)
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
