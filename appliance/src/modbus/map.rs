//! The register map, version 1.4: one table, append-only, from which everything else is derived.
//!
//! A register's scaling is in its row: the expression converts, the text names the step; for gauges
//! it is `Unit::steps` in `algo`. Saturation and "not known" are in `encode`.

use super::encode::{
    MAGIC, TEXT, UNKNOWN_U16, Words, bits, floats, known, last_slot, mask, measured, saturated_u16,
    slots, steps, stored, tenths,
};
use crate::station::{Power, ResultRecord, Snapshot};

/// MAP_VERSION, register 121.
pub const VERSION: u16 = 0x0104;

/// How a register's words are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// 16 single bits.
    Bits,
    /// Unsigned, one register.
    U16,
    /// Signed, one register.
    I16,
    /// Unsigned, two registers.
    U32,
    /// Signed, two registers.
    I32,
    /// Unsigned, four registers.
    U64,
    /// IEEE 754 single, two registers.
    F32,
    /// Two characters per register.
    Ascii,
    /// 32 characters, 16 registers.
    Text,
}

impl Kind {
    /// Registers per item.
    pub const fn width(self) -> u16 {
        match self {
            Self::Bits | Self::U16 | Self::I16 | Self::Ascii => 1,
            Self::U32 | Self::I32 | Self::F32 => 2,
            Self::U64 => 4,
            Self::Text => TEXT,
        }
    }

    /// The word for it.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Bits => "bits",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::Ascii => "ascii",
            Self::Text => "ascii 32",
        }
    }
}

/// A range of addresses that is read as a whole or in parts, but never across its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    /// Its name.
    pub name: &'static str,
    /// First address.
    pub first: u16,
    /// Last address.
    pub last: u16,
    /// Whether FC6, FC16 and FC23 may write it.
    pub writable: bool,
    /// Whether this version of the program serves it; the others answer with exception 2.
    pub served: bool,
}

/// One named item of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Register {
    /// 0-based PDU address of its first register.
    pub address: u16,
    /// Its name, unique in its block.
    pub name: &'static str,
    /// How it is read.
    pub kind: Kind,
    /// The number of consecutive items (for ASCII: of registers).
    pub items: u16,
    /// What it means, with its unit.
    pub meaning: &'static str,
}

impl Register {
    /// How many registers it takes.
    pub const fn count(&self) -> u16 {
        self.items * self.kind.width()
    }
}

/// Declares each block once, with its addresses and whether it can be written, and each row once:
/// address, name, type, number of items, value, meaning. The values come from the snapshot or from
/// the result that the block shows.
macro_rules! registers {
    ($($module:ident $block:ident $first:literal..=$last:literal, $writable:literal, $shown:ident: $from:ty {
        $($address:literal $name:ident $kind:ident x $items:literal = $value:expr, $meaning:literal;)*
    })*) => {
        /// The addresses by block and name, and the rows of each block.
        pub mod at {
            $(
                /// One block.
                pub mod $module {
                    use super::super::{Kind, Register};
                    $(#[doc = $meaning] pub const $name: u16 = $address;)*
                    /// The rows by address.
                    pub const ROWS: &[Register] = &[
                        $(Register { address: $address, name: stringify!($name), kind: Kind::$kind, items: $items, meaning: $meaning },)*
                    ];
                }
            )*
        }
        $(
            #[doc = concat!("Block ", stringify!($block), ".")]
            pub const $block: Block = Block {
                name: stringify!($block),
                first: $first,
                last: $last,
                writable: $writable,
                served: true,
            };
            pub(super) fn $module(words: &mut Words, $shown: &$from) {
                $(words.put($address, $value);)*
            }
        )*
    };
}

registers! {
    control CONTROL 0..=31, true, now: Snapshot {
        0 CONTROL Bits x 1 = now.control.control, "0 ONLINE request, 1 TRIGGER edge, 2 RESULT_ACK edge, 3 RECIPE_LOAD edge, 4 ERROR_RESET edge, 5 ABORT edge, 6 BUFFERED mode, 7 TEACH edge, 8 end of BUFFERED edge, 9-15 must be 0";
        1 TRIGGER_TOKEN U16 x 1 = now.control.token, "a write of a value other than 0 and LAST_TOKEN triggers; echoed at 116 and 202";
        2 RECIPE_SELECT U16 x 1 = now.control.recipe_select, "1-9999; 0 leave the recipe; 65535 select by PART_NUMBER; a trigger is accepted only if it is the active recipe, or 0";
        3 PLC_HEARTBEAT U16 x 1 = now.control.plc_heartbeat, "any changing value; stale for longer than plc_timeout sets a warning bit";
        4 PART_ID U32 x 1 = now.control.part_id, "number of the part, latched at the trigger, returned with the result";
        6 PRESS_STROKE U32 x 1 = now.control.press_stroke, "stroke or pallet counter, latched at the trigger, returned with the result";
        8 PART_NUMBER Ascii x 16 = &now.control.part_number[..], "recipe key, 32 characters";
    }
    status STATUS 100..=131, false, now: Snapshot {
        100 STATUS Bits x 1 = now.status, "0 ONLINE, 1 READY, 2 BUSY, 3 PROCESSING, 4 EXPOSURE_DONE, 5 RESULT_VALID, 6 RESULT_TOGGLE, 7 TRIGGER_ACK, 8 RECIPE_LOADING, 9 RECIPE_OK, 10 WARNING, 11 ERROR, 12 MISSED_TRIGGER, 13 BUFFER_OVERFLOW, 14 WARMING_UP, 15 CALIBRATION_VALID";
        101 HEARTBEAT U16 x 1 = now.heartbeat, "+1 every 100 ms as long as the measuring task meets its deadlines";
        102 ERROR_CODE U16 x 1 = now.error_code, "0 none, 1xx camera, 2xx projector, 3xx sync, 4xx recipe, 5xx calibration, 6xx storage, 7xx thermal, 8xx internal";
        103 WARNING Bits x 1 = now.warnings, "0 temperature, 1 storage, 2 plc_lost, 3 clock_unsynced, 4 low_light, 5 saturation, 6 pattern_unfit, 7 frame_slip, 8 power, 9 geometry, 10 unsteady_light";
        104 STATE U16 x 1 = now.state, "0 boot, 1 ready, 2 acquiring, 3 processing, 4 loading, 5 teaching, 6 offline, 7 fault, 8 stopping, 9 commissioning";
        105 ACTIVE_RECIPE U16 x 1 = now.active().unwrap_or(0), "number of the active recipe, 0 none";
        106 RECIPE_CRC32 U32 x 1 = now.recipe.as_ref().map_or(0, |recipe| recipe.crc), "first 32 bits of the active recipe's fingerprint";
        108 REQUESTED_RECIPE U16 x 1 = now.requested_recipe, "number of the last requested recipe";
        109 RECIPE_RESULT U16 x 1 = now.recipe_result.number(), "0 ok, 1 unknown, 2 damaged, 3 made for another head or calibration, 4 busy, 5 cannot be used as it is stored";
        110 TRIGGERS U32 x 1 = now.triggers, "accepted triggers since the start";
        112 RESULT_SEQ U32 x 1 = now.result_seq, "last completed result; continues across restarts";
        114 MISSED U32 x 1 = now.missed, "rejected triggers since the start";
        116 LAST_TOKEN U16 x 1 = now.last_token, "last accepted token";
        117 BUFFERED U16 x 1 = now.buffered, "results waiting for RESULT_ACK";
        118 UPTIME U32 x 1 = now.uptime_s, "s";
        120 REJECT_REASON U16 x 1 = now.reject_reason, "of the last rejected request: 1 not ready, 2 offline, 3 no recipe, 4 teach not allowed, 5 fault, 6 another recipe is active";
        121 MAP_VERSION U16 x 1 = VERSION, "0x0104";
        122 BOOT_ID U32 x 1 = now.boot_id, "random per start: tokens and counters restarted";
    }
    result RESULT 200..=319, false, record: ResultRecord {
        200 SEQ U32 x 1 = record.seq, "number of this result";
        202 TOKEN U16 x 1 = record.token, "token that triggered, 0 for an edge";
        203 RECIPE U16 x 1 = record.recipe, "recipe number";
        204 RECIPE_CRC32 U32 x 1 = record.recipe_crc, "first 32 bits of the recipe's fingerprint";
        206 PART_ID U32 x 1 = record.part_id, "as latched at the trigger";
        208 VERDICT U16 x 1 = record.verdict.number(), "0 none, 1 PASS, 2 FAIL, 3 INVALID";
        209 ERROR_CODE U16 x 1 = record.error_code, "of this result, 0 none";
        210 PASS U32 x 1 = mask(record, |decision| decision.pass && decision.valid), "bits, gauge k = bit k: slot s is bit s - 1, s = 1-16";
        212 VALID U32 x 1 = mask(record, |decision| decision.valid), "bits, gauge k = bit k: slot s is bit s - 1, s = 1-16";
        214 TIME U64 x 1 = record.time_utc_us, "us since 1970 UTC of the trigger, 0 if the clock is not synchronised";
        218 EXPOSURE_TIME U32 x 1 = record.exposure_us, "us, trigger to exposure done";
        220 TOTAL_TIME U32 x 1 = record.total_us, "us, trigger to result";
        222 VALID_POINTS U32 x 1 = record.inspection.valid_points, "resolved pixels";
        224 COVERAGE U16 x 1 = record.inspection.coverage_permille, "per mille of the surface compared with golden that are resolved, as min_coverage of the recipe; a gauge of the coverage is of its region";
        225 TEMPERATURE I16 x 1 = tenths(record.inspection.temperature_c), "head, 0.1 degC, 0x8000 not known";
        226 HEIGHT_NOISE U16 x 1 = saturated_u16(record.inspection.height_noise_mm * 10_000.0), "0.1 um, 1 sigma, from the measured modulation";
        227 GAUGE_COUNT U16 x 1 = last_slot(record, 16), "0-16, the highest occupied of slots 1-16";
        228 PRESS_STROKE U32 x 1 = record.press_stroke, "as latched at the trigger";
        230 FITNESS U16 x 1 = record.inspection.fitness_permille, "per mille, 1000 = pattern as taught";
        231 FLAGS Bits x 1 = record.flags(), "0 a pattern was retried, 1 single level used, 2 two levels used, 3 full sequence used, 4 stepped up from a shorter one, 5 simulated head, 6 warm-up, 7 at least one doubtful decision, 8 the recipe judges nothing: no gauge has a limit that a part can miss";
        232 GAUGE_STEPS I32 x 16 = steps::<16>(record), "value in the unit's step: length 0.1 um, angle 0.0001 deg, volume 0.01 mm3, share 0.1 per mille; saturates at +-(2^31-1), 0x80000000 invalid";
        264 GAUGE_VALUE F32 x 16 = floats::<16>(record, |gauge| measured(gauge, gauge.value)), "the same in mm, deg, mm3, share 0-1; NaN (0x7FC00000) invalid";
        296 GAUGE_DECISION Bits x 16 = slots::<_, 16>(record, 0, |gauge| gauge.decision.bits()), "0 pass, 1 valid, 2 low, 3 high, 4 doubtful (a limit lies within 2 sigma); 1 and 4 without 0, 2, 3: inside its limits, but nearer to one than the recipe's guard band; 5 absent";
        318 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauge_detail GAUGE_DETAIL 520..=583, false, record: ResultRecord {
        520 SEQ U32 x 1 = record.seq, "number of the result";
        522 GAUGE_SIGMA F32 x 16 = floats::<16>(record, |gauge| measured(gauge, gauge.sigma)), "1 sigma of each gauge, in mm, deg, mm3, share 0-1; NaN (0x7FC00000) not known";
        554 GAUGE_UNIT U16 x 16 = slots::<_, 16>(record, 0, |gauge| gauge.unit.number()), "0 none, 1 length, 2 angle, 3 volume, 4 share";
        582 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    health HEALTH 600..=639, false, now: Snapshot {
        600 CAMERA_FPS U32 x 1 = now.health.pace.camera_centihertz, "frames per second x 100, last sequence";
        602 PROJECTOR_REFRESH U32 x 1 = now.health.pace.refresh_millihertz, "mHz";
        604 SYNC_ERROR I32 x 1 = now.health.pace.lag_us.min(i32::MAX.cast_unsigned()), "us, longest time in the last sequence from a pattern in view to its exposure";
        606 DROPPED_FRAMES U32 x 1 = now.health.pace.dropped, "since the start";
        608 MISSED_FLIPS U32 x 1 = now.health.pace.missed_flips, "since the start";
        610 PROCESSING_TIME U32 x 1 = now.health.processing_us, "us, last cycle";
        612 PROCESSING_TIME_MAX U32 x 1 = now.health.processing_max_us, "us, since the start";
        614 STORAGE_ERRORS U32 x 1 = now.health.storage_errors, "write errors";
        616 BOOTS U32 x 1 = now.health.system.boots, "starts";
        618 UNCLEAN_BOOTS U32 x 1 = now.health.system.unclean_boots, "starts after a crash or power loss";
        620 WATCHDOG_RESTARTS U32 x 1 = now.health.system.watchdog_restarts, "unclean boots after the measuring task had missed its deadlines for 10 s: what a watchdog or a person then ended";
        622 CPU_LOAD U16 x 1 = known(now.health.system.cpu_percent.map(u64::from)), "%, 65535 not known";
        623 FREE_MEMORY U16 x 1 = known(now.health.system.free_memory_mib), "MiB, saturating at 65534, 65535 not known";
        624 FREE_STORAGE U16 x 1 = known(now.health.system.free_storage_mib), "MiB, saturating at 65534, 65535 not known";
        625 CPU_TEMPERATURE I16 x 1 = tenths(now.health.system.cpu_temperature_c), "0.1 degC, 0x8000 not known";
        626 CAMERA_TEMPERATURE I16 x 1 = tenths(now.health.camera_temperature_c), "0.1 degC, 0x8000 not known";
        627 PROJECTOR_TEMPERATURE I16 x 1 = tenths(now.health.projector.temperature_c), "0.1 degC, 0x8000 not known";
        628 MODBUS_CLIENTS U16 x 1 = now.health.system.clients, "open connections";
        629 WRITER_CONNECTED U16 x 1 = u16::from(now.health.system.writer_connected), "1 if a client that may write is connected";
        630 POWER Bits x 1 = now.health.system.power.map_or(UNKNOWN_U16, Power::bits), "0 under-voltage, 1 frequency capped, 2 throttled, 3 soft temperature limit, 4-7 the same at any time since the computer's start, 0xFFFF not known";
        631 PROJECTOR_FAULT Bits x 1 = now.health.projector.faults.unwrap_or(UNKNOWN_U16), "0 micromirror device, 1 LED, 2 sequence, 3 low supply voltage, 4 timing of patterns, 5 product configuration, 6 watchdog, 7 flash memory, 0xFFFF not known";
        632 LED_CURRENT U16 x 1 = known(now.health.projector.led_current.map(u64::from)), "of the projector, steps of the LED's driver, 65535 not known";
        633 KERNEL_VERSION U16 x 2 = now.health.system.kernel.unwrap_or([UNKNOWN_U16; 2]), "major, minor; 65535 not known";
        635 LIBCAMERA_VERSION U16 x 2 = now.health.system.libcamera.unwrap_or([UNKNOWN_U16; 2]), "major, minor; 65535 not known";
        637 DRIFT U16 x 1 = known(now.health.drift.map(|drift| (drift.rms_px * 1000.0).round() as u64)), "0.001 projector pixels, RMS distance from the epipolar lines at the last check of the geometry, saturating at 65534, 65535 not known";
    }
    recipe_directory RECIPE_DIRECTORY 700..=763, false, now: Snapshot {
        700 STORED_RECIPES Bits x 64 = stored(&now.health.system.recipes), "recipe r in register 700 + (r - 1) / 16, bit (r - 1) mod 16, r = 1-1024";
    }
    identity IDENTITY 900..=939, false, now: Snapshot {
        900 MAGIC U32 x 1 = MAGIC, "0x46524E47 (FRNG)";
        902 SERIAL Ascii x 16 = &*now.identity.serial, "32 characters";
        918 VERSION Ascii x 16 = &*now.identity.version, "32 characters";
        936 TEST_U32 U32 x 1 = 0x1234_5678_u32, "0x12345678, word order test";
        938 TEST_F32 F32 x 1 = 123.456_f32.to_bits(), "123.456, word order test";
    }
    gauge_uncertainty GAUGE_UNCERTAINTY 1000..=1069, false, record: ResultRecord {
        1000 SEQ U32 x 1 = record.seq, "number of the result";
        1002 GAUGE_U F32 x 16 = floats::<16>(record, |gauge| measured(gauge, gauge.uncertainty)), "expanded uncertainty of each gauge, k = 2, with the systematic part, in mm, deg, mm3, share 0-1; NaN (0x7FC00000) not known";
        1034 GAUGE_EXPECTED F32 x 16 = floats::<16>(record, |gauge| measured(gauge, gauge.expected)), "magnitude that is expected on a good part, of an extreme, in the same units; NaN (0x7FC00000) where noise does not move the value away from 0";
        1066 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges GAUGES 1100..=1183, false, record: ResultRecord {
        1100 SEQ U32 x 1 = record.seq, "number of the result";
        1102 VERDICT U16 x 1 = record.verdict.number(), "0 none, 1 PASS, 2 FAIL, 3 INVALID; all slots count";
        1103 LAST_SLOT U16 x 1 = last_slot(record, 64), "0-64, the highest occupied slot";
        1104 PASS Bits x 4 = bits(record, |decision| decision.pass && decision.valid), "slot s is bit (s - 1) mod 16 of register (s - 1) / 16 of these";
        1108 VALID Bits x 4 = bits(record, |decision| decision.valid), "slot s is bit (s - 1) mod 16 of register (s - 1) / 16 of these";
        1112 FAILED Bits x 4 = bits(record, |decision| decision.failed()), "outside a limit, or absent; slot s is bit (s - 1) mod 16 of register (s - 1) / 16 of these";
        1116 DECISION Bits x 64 = slots::<_, 64>(record, 0, |gauge| gauge.decision.bits()), "of each slot: 0 pass, 1 valid, 2 low, 3 high, 4 doubtful, 5 absent, as GAUGE_DECISION; 0 for an empty slot";
        1180 TOKEN U16 x 1 = record.token, "token that triggered, 0 for an edge";
        1182 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_value GAUGES_VALUE 1200..=1331, false, record: ResultRecord {
        1200 SEQ U32 x 1 = record.seq, "number of the result";
        1202 VALUE F32 x 64 = floats::<64>(record, |gauge| measured(gauge, gauge.value)), "of each slot in mm, deg, mm3, share 0-1; NaN (0x7FC00000) invalid";
        1330 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_steps GAUGES_STEPS 1400..=1531, false, record: ResultRecord {
        1400 SEQ U32 x 1 = record.seq, "number of the result";
        1402 STEPS I32 x 64 = steps::<64>(record), "the same in the unit's step, as GAUGE_STEPS; 0x80000000 invalid";
        1530 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_sigma GAUGES_SIGMA 1600..=1731, false, record: ResultRecord {
        1600 SEQ U32 x 1 = record.seq, "number of the result";
        1602 SIGMA F32 x 64 = floats::<64>(record, |gauge| measured(gauge, gauge.sigma)), "1 sigma of each slot's value in its unit; NaN (0x7FC00000) not known";
        1730 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_u GAUGES_U 1800..=1931, false, record: ResultRecord {
        1800 SEQ U32 x 1 = record.seq, "number of the result";
        1802 U F32 x 64 = floats::<64>(record, |gauge| measured(gauge, gauge.uncertainty)), "expanded uncertainty of each slot's value, k = 2, as GAUGE_U; NaN (0x7FC00000) not known";
        1930 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_unit GAUGES_UNIT 3000..=3067, false, record: ResultRecord {
        3000 SEQ U32 x 1 = record.seq, "number of the result";
        3002 UNIT U16 x 64 = slots::<_, 64>(record, 0, |gauge| gauge.unit.number()), "of each slot: 0 none, 1 length, 2 angle, 3 volume, 4 share";
        3066 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_low GAUGES_LOW 3100..=3231, false, record: ResultRecord {
        3100 SEQ U32 x 1 = record.seq, "number of the result";
        3102 LOW F32 x 64 = floats::<64>(record, |gauge| gauge.low), "lower limit of each slot in mm, deg, mm3, share 0-1; NaN (0x7FC00000) without one";
        3230 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_high GAUGES_HIGH 3300..=3431, false, record: ResultRecord {
        3300 SEQ U32 x 1 = record.seq, "number of the result";
        3302 HIGH F32 x 64 = floats::<64>(record, |gauge| gauge.high), "upper limit of each slot, as LOW";
        3430 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
    gauges_name GAUGES_NAME 4000..=5027, false, record: ResultRecord {
        4000 SEQ U32 x 1 = record.seq, "number of the result";
        4002 NAME Text x 64 = slots::<_, 64>(record, "", |gauge| &*gauge.name), "of each slot, its first 32 characters";
        5026 SEQ_AGAIN U32 x 1 = record.seq, "equals SEQ unless two reads were mixed";
    }
}

/// A block with the layout of another one, that shows the oldest unacknowledged result.
const fn oldest(name: &'static str, first: u16, layout: Block) -> Block {
    Block {
        name,
        first,
        last: first + (layout.last - layout.first),
        ..layout
    }
}

/// Block OLDEST: the layout of RESULT.
pub const OLDEST: Block = oldest("OLDEST", 400, RESULT);
/// Block OLDEST_GAUGES: the layout of GAUGES.
pub const OLDEST_GAUGES: Block = oldest("OLDEST_GAUGES", 2100, GAUGES);
/// Block OLDEST_GAUGES_VALUE: the layout of GAUGES_VALUE.
pub const OLDEST_GAUGES_VALUE: Block = oldest("OLDEST_GAUGES_VALUE", 2200, GAUGES_VALUE);
/// Block OLDEST_GAUGES_STEPS: the layout of GAUGES_STEPS.
pub const OLDEST_GAUGES_STEPS: Block = oldest("OLDEST_GAUGES_STEPS", 2400, GAUGES_STEPS);
/// Block OLDEST_GAUGES_SIGMA: the layout of GAUGES_SIGMA.
pub const OLDEST_GAUGES_SIGMA: Block = oldest("OLDEST_GAUGES_SIGMA", 2600, GAUGES_SIGMA);
/// Block OLDEST_GAUGES_U: the layout of GAUGES_U.
pub const OLDEST_GAUGES_U: Block = oldest("OLDEST_GAUGES_U", 2800, GAUGES_U);

/// What the values of a block come from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source {
    /// What holds now.
    Now(fn(&mut Words, &Snapshot)),
    /// The newest result.
    Newest(fn(&mut Words, &ResultRecord)),
    /// The oldest result that was not acknowledged.
    Oldest(fn(&mut Words, &ResultRecord)),
}

/// Every block with its rows by address, those of its layout, and what its values come from.
pub(super) const BLOCKS: [(Block, &[Register], Source); 23] = [
    (CONTROL, at::control::ROWS, Source::Now(control)),
    (STATUS, at::status::ROWS, Source::Now(status)),
    (RESULT, at::result::ROWS, Source::Newest(result)),
    (OLDEST, at::result::ROWS, Source::Oldest(result)),
    (
        GAUGE_DETAIL,
        at::gauge_detail::ROWS,
        Source::Newest(gauge_detail),
    ),
    (HEALTH, at::health::ROWS, Source::Now(health)),
    (
        RECIPE_DIRECTORY,
        at::recipe_directory::ROWS,
        Source::Now(recipe_directory),
    ),
    (IDENTITY, at::identity::ROWS, Source::Now(identity)),
    (
        GAUGE_UNCERTAINTY,
        at::gauge_uncertainty::ROWS,
        Source::Newest(gauge_uncertainty),
    ),
    (GAUGES, at::gauges::ROWS, Source::Newest(gauges)),
    (
        GAUGES_VALUE,
        at::gauges_value::ROWS,
        Source::Newest(gauges_value),
    ),
    (
        GAUGES_STEPS,
        at::gauges_steps::ROWS,
        Source::Newest(gauges_steps),
    ),
    (
        GAUGES_SIGMA,
        at::gauges_sigma::ROWS,
        Source::Newest(gauges_sigma),
    ),
    (GAUGES_U, at::gauges_u::ROWS, Source::Newest(gauges_u)),
    (OLDEST_GAUGES, at::gauges::ROWS, Source::Oldest(gauges)),
    (
        OLDEST_GAUGES_VALUE,
        at::gauges_value::ROWS,
        Source::Oldest(gauges_value),
    ),
    (
        OLDEST_GAUGES_STEPS,
        at::gauges_steps::ROWS,
        Source::Oldest(gauges_steps),
    ),
    (
        OLDEST_GAUGES_SIGMA,
        at::gauges_sigma::ROWS,
        Source::Oldest(gauges_sigma),
    ),
    (
        OLDEST_GAUGES_U,
        at::gauges_u::ROWS,
        Source::Oldest(gauges_u),
    ),
    (
        GAUGES_UNIT,
        at::gauges_unit::ROWS,
        Source::Newest(gauges_unit),
    ),
    (GAUGES_LOW, at::gauges_low::ROWS, Source::Newest(gauges_low)),
    (
        GAUGES_HIGH,
        at::gauges_high::ROWS,
        Source::Newest(gauges_high),
    ),
    (
        GAUGES_NAME,
        at::gauges_name::ROWS,
        Source::Newest(gauges_name),
    ),
];

/// Every row of the map with its address and block.
pub fn registers() -> impl Iterator<Item = (Block, Register)> {
    BLOCKS.into_iter().flat_map(|(block, rows, _)| {
        rows.iter().map(move |row| {
            let address = block.first + (row.address - rows[0].address);
            (block, Register { address, ..*row })
        })
    })
}

/// The served block that holds all of `quantity` registers from `address` on.
pub fn served(address: u16, quantity: u16) -> Option<Block> {
    let last = address.checked_add(quantity.checked_sub(1)?)?;
    let holds = |block: &Block| block.served && block.first <= address && last <= block.last;
    BLOCKS.into_iter().map(|(block, ..)| block).find(holds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_lie_inside_their_block_in_order_without_overlap() {
        let mut free = 0;
        for (block, row) in registers() {
            let last = row.address + row.count() - 1;
            assert!(
                row.address >= free && row.address >= block.first && last <= block.last,
                "{} {}",
                block.name,
                row.name
            );
            free = last + 1;
        }
    }

    #[test]
    fn every_32_bit_item_sits_at_an_even_address() {
        for (block, row) in registers().filter(|(_, row)| row.kind.width() > 1) {
            assert_eq!(row.address % 2, 0, "{} {}", block.name, row.name);
        }
    }

    #[test]
    fn a_range_is_served_only_inside_one_block() {
        assert_eq!(served(200, 120), Some(RESULT));
        assert_eq!(served(200, 121), None);
        assert_eq!(served(31, 2), None);
        assert_eq!(served(32, 1), None);
        assert_eq!(served(u16::MAX, 2), None);
        assert_eq!(served(0, 0), None);
        assert_eq!(served(600, 40), Some(HEALTH));
        assert_eq!(served(639, 2), None);
    }
}
