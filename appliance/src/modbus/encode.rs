//! From a snapshot to the 16-bit words of each block.

use super::map::{self, Block, at};
use crate::config::WordOrder;
use crate::station::{GaugeValue, Health, ResultRecord, Snapshot};
use std::sync::Arc;

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
struct Words {
    first: u16,
    words: Vec<u16>,
    order: WordOrder,
}

impl Words {
    fn of(block: &Block, order: WordOrder) -> Self {
        let count = usize::from(block.last - block.first) + 1;
        Self {
            first: block.first,
            words: vec![0; count],
            order,
        }
    }

    fn u16(&mut self, address: u16, word: u16) {
        // Every address comes from the table, whose rows lie inside their block (tested there).
        if let Some(place) = address
            .checked_sub(self.first)
            .and_then(|k| self.words.get_mut(usize::from(k)))
        {
            *place = word;
        }
    }

    fn many<const N: usize>(&mut self, address: u16, mut words: [u16; N]) {
        if self.order == WordOrder::Swapped {
            words.reverse();
        }
        for (address, word) in (address..).zip(words) {
            self.u16(address, word);
        }
    }

    fn u32(&mut self, address: u16, value: u32) {
        let [a, b, c, d] = value.to_be_bytes();
        self.many(
            address,
            [u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])],
        );
    }

    fn u64(&mut self, address: u16, value: u64) {
        let [a, b, c, d, e, f, g, h] = value.to_be_bytes();
        self.many(
            address,
            [[a, b], [c, d], [e, f], [g, h]].map(u16::from_be_bytes),
        );
    }

    fn bytes(&mut self, address: u16, bytes: &[u8]) {
        for (address, pair) in (address..).zip(bytes.chunks(2)) {
            let low = pair.get(1).copied().unwrap_or(0);
            self.u16(
                address,
                u16::from_be_bytes([pair.first().copied().unwrap_or(0), low]),
            );
        }
    }

    /// At most 32 characters, NUL padded; characters that are not ASCII become `?`.
    fn ascii32(&mut self, address: u16, text: &str) {
        let ascii: Vec<u8> = text
            .chars()
            .take(32)
            .map(|c| u8::try_from(c).ok().filter(u8::is_ascii).unwrap_or(b'?'))
            .collect();
        self.bytes(address, &ascii);
    }
}

/// The words of a block, `block.last - block.first + 1` of them; zeros for a block that is not served.
pub fn block_words(snapshot: &Snapshot, block: &Block, order: WordOrder) -> Vec<u16> {
    let mut words = Words::of(block, order);
    // Without a result the block shows an empty one, all of whose gauges are invalid.
    let shown = |record: &Option<Arc<ResultRecord>>| record.clone().unwrap_or_default();
    match *block {
        map::CONTROL => control(&mut words, snapshot),
        map::STATUS => status(&mut words, snapshot),
        map::RESULT => result(&mut words, &shown(&snapshot.result)),
        map::OLDEST => {
            // The same layout: written at RESULT's addresses, read at its own.
            words.first = map::RESULT.first;
            result(&mut words, &shown(&snapshot.oldest));
        }
        map::GAUGE_DETAIL => gauge_detail(&mut words, &shown(&snapshot.result)),
        map::HEALTH => health(&mut words, &snapshot.health),
        map::RECIPE_DIRECTORY => recipe_directory(&mut words, &snapshot.health.system.recipes),
        map::IDENTITY => {
            words.u32(at::identity::MAGIC, MAGIC);
            words.ascii32(at::identity::SERIAL, &snapshot.identity.serial);
            words.ascii32(at::identity::VERSION, &snapshot.identity.version);
            words.u32(at::identity::TEST_U32, 0x1234_5678);
            words.u32(at::identity::TEST_F32, 123.456_f32.to_bits());
        }
        _ => {}
    }
    words.words
}

fn control(words: &mut Words, snapshot: &Snapshot) {
    let control = &snapshot.control;
    words.u16(at::control::CONTROL, control.control);
    words.u16(at::control::TRIGGER_TOKEN, control.token);
    words.u16(at::control::RECIPE_SELECT, control.recipe_select);
    words.u16(at::control::PLC_HEARTBEAT, control.plc_heartbeat);
    words.u32(at::control::PART_ID, control.part_id);
    words.u32(at::control::PRESS_STROKE, control.press_stroke);
    words.bytes(at::control::PART_NUMBER, &control.part_number);
}

fn status(words: &mut Words, snapshot: &Snapshot) {
    use at::status as a;
    words.u16(a::STATUS, snapshot.status);
    words.u16(a::HEARTBEAT, snapshot.heartbeat);
    words.u16(a::ERROR_CODE, snapshot.error_code);
    words.u16(a::WARNING, snapshot.warnings);
    words.u16(a::STATE, snapshot.state);
    words.u16(a::ACTIVE_RECIPE, snapshot.active().unwrap_or(0));
    words.u32(
        a::RECIPE_CRC32,
        snapshot.recipe.as_ref().map_or(0, |recipe| recipe.crc),
    );
    words.u16(a::REQUESTED_RECIPE, snapshot.requested_recipe);
    words.u16(a::RECIPE_RESULT, snapshot.recipe_result.number());
    words.u32(a::TRIGGERS, snapshot.triggers);
    words.u32(a::RESULT_SEQ, snapshot.result_seq);
    words.u32(a::MISSED, snapshot.missed);
    words.u16(a::LAST_TOKEN, snapshot.last_token);
    words.u16(a::BUFFERED, snapshot.buffered);
    words.u32(a::UPTIME, snapshot.uptime_s);
    words.u16(a::REJECT_REASON, snapshot.reject_reason);
    words.u16(a::MAP_VERSION, map::VERSION);
    words.u32(a::BOOT_ID, snapshot.boot_id);
}

fn result(words: &mut Words, record: &ResultRecord) {
    use at::result as a;
    let found = &record.inspection;
    let mask = |set: fn(&GaugeValue) -> bool| {
        found
            .gauges
            .iter()
            .enumerate()
            .fold(0, |mask, (k, gauge)| mask | (u32::from(set(gauge)) << k))
    };
    words.u32(a::SEQ, record.seq);
    words.u16(a::TOKEN, record.token);
    words.u16(a::RECIPE, record.recipe);
    words.u32(a::RECIPE_CRC32, record.recipe_crc);
    words.u32(a::PART_ID, record.part_id);
    words.u16(a::VERDICT, record.verdict.number());
    words.u16(a::ERROR_CODE, record.error_code);
    words.u32(
        a::PASS,
        mask(|gauge| gauge.decision.pass && gauge.decision.valid),
    );
    words.u32(a::VALID, mask(|gauge| gauge.decision.valid));
    words.u64(a::TIME, record.time_utc_us);
    words.u32(a::EXPOSURE_TIME, record.exposure_us);
    words.u32(a::TOTAL_TIME, record.total_us);
    words.u32(a::VALID_POINTS, found.valid_points);
    words.u16(a::COVERAGE, found.coverage_permille);
    words.u16(a::TEMPERATURE, tenths(found.temperature_c));
    words.u16(
        a::HEIGHT_NOISE,
        saturated_u16(found.height_noise_mm * 10_000.0),
    );
    words.u16(
        a::GAUGE_COUNT,
        u16::try_from(found.gauges.len()).unwrap_or(u16::MAX),
    );
    words.u32(a::PRESS_STROKE, record.press_stroke);
    words.u16(a::FITNESS, found.fitness_permille);
    words.u16(a::FLAGS, record.flags());
    for k in 0..map::GAUGES {
        let gauge = found.gauges.get(usize::from(k));
        // Shown only if it is valid: a number beside VALID = 0 would be taken for a measurement.
        let value = gauge
            .filter(|gauge| gauge.decision.valid)
            .and_then(|gauge| gauge.value);
        let steps = gauge.map_or(1.0, |gauge| gauge.unit.steps());
        words.u32(a::GAUGE_STEPS + 2 * k, i32_steps(value, steps));
        words.u32(a::GAUGE_VALUE + 2 * k, f32_bits(value));
        words.u16(
            a::GAUGE_DECISION + k,
            gauge.map_or(0, |gauge| gauge.decision.bits()),
        );
    }
    words.u32(a::SEQ_AGAIN, record.seq);
}

fn gauge_detail(words: &mut Words, record: &ResultRecord) {
    use at::gauge_detail as a;
    words.u32(a::SEQ, record.seq);
    for k in 0..map::GAUGES {
        let gauge = record.inspection.gauges.get(usize::from(k));
        let sigma = gauge
            .filter(|gauge| gauge.decision.valid)
            .and_then(|gauge| gauge.sigma);
        words.u32(a::GAUGE_SIGMA + 2 * k, f32_bits(sigma));
        words.u16(
            a::GAUGE_UNIT + k,
            gauge.map_or(0, |gauge| gauge.unit.number()),
        );
    }
    words.u32(a::SEQ_AGAIN, record.seq);
}

fn health(words: &mut Words, health: &Health) {
    use at::health as a;
    let (pace, system) = (&health.pace, &health.system);
    let lag = i32::try_from(pace.lag_us).unwrap_or(i32::MAX);
    words.u32(a::CAMERA_FPS, pace.camera_centihertz);
    words.u32(a::PROJECTOR_REFRESH, pace.refresh_millihertz);
    words.u32(a::SYNC_ERROR, lag.cast_unsigned());
    words.u32(a::DROPPED_FRAMES, pace.dropped);
    words.u32(a::MISSED_FLIPS, pace.missed_flips);
    words.u32(a::PROCESSING_TIME, health.processing_us);
    words.u32(a::PROCESSING_TIME_MAX, health.processing_max_us);
    words.u32(a::STORAGE_ERRORS, health.storage_errors);
    words.u32(a::BOOTS, system.boots);
    words.u32(a::UNCLEAN_BOOTS, system.unclean_boots);
    words.u32(a::WATCHDOG_RESTARTS, system.watchdog_restarts);
    words.u16(a::CPU_LOAD, known(system.cpu_percent.map(u64::from)));
    words.u16(a::FREE_MEMORY, known(system.free_memory_mib));
    words.u16(a::FREE_STORAGE, known(system.free_storage_mib));
    words.u16(a::CPU_TEMPERATURE, tenths(system.cpu_temperature_c));
    // No head of this version has a thermometer.
    words.u16(a::CAMERA_TEMPERATURE, UNKNOWN_I16);
    words.u16(a::PROJECTOR_TEMPERATURE, UNKNOWN_I16);
    words.u16(a::MODBUS_CLIENTS, system.clients);
    words.u16(a::WRITER_CONNECTED, u16::from(system.writer_connected));
}

fn recipe_directory(words: &mut Words, stored: &[u16]) {
    let first = at::recipe_directory::STORED_RECIPES;
    for register in 0..=map::RECIPE_DIRECTORY.last - map::RECIPE_DIRECTORY.first {
        let bits = (0..16).filter(|bit| stored.binary_search(&(16 * register + bit + 1)).is_ok());
        words.u16(first + register, bits.fold(0, |word, bit| word | 1 << bit));
    }
}

/// A number, saturated below the value that means "not known".
fn known(value: Option<u64>) -> u16 {
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

fn tenths(celsius: Option<f64>) -> u16 {
    celsius
        .filter(|value| value.is_finite())
        .map_or(UNKNOWN_I16, |value| {
            let whole = (value * 10.0).round().clamp(-32_767.0, 32_767.0) as i16;
            u16::from_be_bytes(whole.to_be_bytes())
        })
}

fn saturated_u16(value: f64) -> u16 {
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
