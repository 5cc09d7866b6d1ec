//! The map, word for word. If this test fails, do not change what stands in its lists: the map is
//! append-only. What is added gets a line.

use crate::modbus::map::{BLOCKS, Register, VERSION, registers};
use crate::modbus::render::{registers_csv, registers_json};

/// Address, name, type and block of every row.
const ROWS: &str = "\
0 CONTROL bits CONTROL
1 TRIGGER_TOKEN u16 CONTROL
2 RECIPE_SELECT u16 CONTROL
3 PLC_HEARTBEAT u16 CONTROL
4 PART_ID u32 CONTROL
6 PRESS_STROKE u32 CONTROL
8 PART_NUMBER ascii32 CONTROL
100 STATUS bits STATUS
101 HEARTBEAT u16 STATUS
102 ERROR_CODE u16 STATUS
103 WARNING bits STATUS
104 STATE u16 STATUS
105 ACTIVE_RECIPE u16 STATUS
106 RECIPE_CRC32 u32 STATUS
108 REQUESTED_RECIPE u16 STATUS
109 RECIPE_RESULT u16 STATUS
110 TRIGGERS u32 STATUS
112 RESULT_SEQ u32 STATUS
114 MISSED u32 STATUS
116 LAST_TOKEN u16 STATUS
117 BUFFERED u16 STATUS
118 UPTIME u32 STATUS
120 REJECT_REASON u16 STATUS
121 MAP_VERSION u16 STATUS
122 BOOT_ID u32 STATUS
200 SEQ u32 RESULT
202 TOKEN u16 RESULT
203 RECIPE u16 RESULT
204 RECIPE_CRC32 u32 RESULT
206 PART_ID u32 RESULT
208 VERDICT u16 RESULT
209 ERROR_CODE u16 RESULT
210 PASS u32 RESULT
212 VALID u32 RESULT
214 TIME u64 RESULT
218 EXPOSURE_TIME u32 RESULT
220 TOTAL_TIME u32 RESULT
222 VALID_POINTS u32 RESULT
224 COVERAGE u16 RESULT
225 TEMPERATURE i16 RESULT
226 HEIGHT_NOISE u16 RESULT
227 GAUGE_COUNT u16 RESULT
228 PRESS_STROKE u32 RESULT
230 FITNESS u16 RESULT
231 FLAGS bits RESULT
232 GAUGE_STEPS i32x16 RESULT
264 GAUGE_VALUE f32x16 RESULT
296 GAUGE_DECISION bitsx16 RESULT
318 SEQ_AGAIN u32 RESULT
400 SEQ u32 OLDEST
402 TOKEN u16 OLDEST
403 RECIPE u16 OLDEST
404 RECIPE_CRC32 u32 OLDEST
406 PART_ID u32 OLDEST
408 VERDICT u16 OLDEST
409 ERROR_CODE u16 OLDEST
410 PASS u32 OLDEST
412 VALID u32 OLDEST
414 TIME u64 OLDEST
418 EXPOSURE_TIME u32 OLDEST
420 TOTAL_TIME u32 OLDEST
422 VALID_POINTS u32 OLDEST
424 COVERAGE u16 OLDEST
425 TEMPERATURE i16 OLDEST
426 HEIGHT_NOISE u16 OLDEST
427 GAUGE_COUNT u16 OLDEST
428 PRESS_STROKE u32 OLDEST
430 FITNESS u16 OLDEST
431 FLAGS bits OLDEST
432 GAUGE_STEPS i32x16 OLDEST
464 GAUGE_VALUE f32x16 OLDEST
496 GAUGE_DECISION bitsx16 OLDEST
518 SEQ_AGAIN u32 OLDEST
520 SEQ u32 GAUGE_DETAIL
522 GAUGE_SIGMA f32x16 GAUGE_DETAIL
554 GAUGE_UNIT u16x16 GAUGE_DETAIL
582 SEQ_AGAIN u32 GAUGE_DETAIL
600 CAMERA_FPS u32 HEALTH
602 PROJECTOR_REFRESH u32 HEALTH
604 SYNC_ERROR i32 HEALTH
606 DROPPED_FRAMES u32 HEALTH
608 MISSED_FLIPS u32 HEALTH
610 PROCESSING_TIME u32 HEALTH
612 PROCESSING_TIME_MAX u32 HEALTH
614 STORAGE_ERRORS u32 HEALTH
616 BOOTS u32 HEALTH
618 UNCLEAN_BOOTS u32 HEALTH
620 WATCHDOG_RESTARTS u32 HEALTH
622 CPU_LOAD u16 HEALTH
623 FREE_MEMORY u16 HEALTH
624 FREE_STORAGE u16 HEALTH
625 CPU_TEMPERATURE i16 HEALTH
626 CAMERA_TEMPERATURE i16 HEALTH
627 PROJECTOR_TEMPERATURE i16 HEALTH
628 MODBUS_CLIENTS u16 HEALTH
629 WRITER_CONNECTED u16 HEALTH
630 POWER bits HEALTH
631 PROJECTOR_FAULT bits HEALTH
632 LED_CURRENT u16 HEALTH
633 KERNEL_VERSION u16x2 HEALTH
635 LIBCAMERA_VERSION u16x2 HEALTH
637 DRIFT u16 HEALTH
700 STORED_RECIPES bitsx64 RECIPE_DIRECTORY
900 MAGIC u32 IDENTITY
902 SERIAL ascii32 IDENTITY
918 VERSION ascii32 IDENTITY
936 TEST_U32 u32 IDENTITY
938 TEST_F32 f32 IDENTITY
1000 SEQ u32 GAUGE_UNCERTAINTY
1002 GAUGE_U f32x16 GAUGE_UNCERTAINTY
1034 GAUGE_EXPECTED f32x16 GAUGE_UNCERTAINTY
1066 SEQ_AGAIN u32 GAUGE_UNCERTAINTY";

/// The rows that version 1.4 has added.
const ROWS_1_4: &str = "\
1100 SEQ u32 GAUGES
1102 VERDICT u16 GAUGES
1103 LAST_SLOT u16 GAUGES
1104 PASS bitsx4 GAUGES
1108 VALID bitsx4 GAUGES
1112 FAILED bitsx4 GAUGES
1116 DECISION bitsx64 GAUGES
1180 TOKEN u16 GAUGES
1182 SEQ_AGAIN u32 GAUGES
1200 SEQ u32 GAUGES_VALUE
1202 VALUE f32x64 GAUGES_VALUE
1330 SEQ_AGAIN u32 GAUGES_VALUE
1400 SEQ u32 GAUGES_STEPS
1402 STEPS i32x64 GAUGES_STEPS
1530 SEQ_AGAIN u32 GAUGES_STEPS
1600 SEQ u32 GAUGES_SIGMA
1602 SIGMA f32x64 GAUGES_SIGMA
1730 SEQ_AGAIN u32 GAUGES_SIGMA
1800 SEQ u32 GAUGES_U
1802 U f32x64 GAUGES_U
1930 SEQ_AGAIN u32 GAUGES_U
2100 SEQ u32 OLDEST_GAUGES
2102 VERDICT u16 OLDEST_GAUGES
2103 LAST_SLOT u16 OLDEST_GAUGES
2104 PASS bitsx4 OLDEST_GAUGES
2108 VALID bitsx4 OLDEST_GAUGES
2112 FAILED bitsx4 OLDEST_GAUGES
2116 DECISION bitsx64 OLDEST_GAUGES
2180 TOKEN u16 OLDEST_GAUGES
2182 SEQ_AGAIN u32 OLDEST_GAUGES
2200 SEQ u32 OLDEST_GAUGES_VALUE
2202 VALUE f32x64 OLDEST_GAUGES_VALUE
2330 SEQ_AGAIN u32 OLDEST_GAUGES_VALUE
2400 SEQ u32 OLDEST_GAUGES_STEPS
2402 STEPS i32x64 OLDEST_GAUGES_STEPS
2530 SEQ_AGAIN u32 OLDEST_GAUGES_STEPS
2600 SEQ u32 OLDEST_GAUGES_SIGMA
2602 SIGMA f32x64 OLDEST_GAUGES_SIGMA
2730 SEQ_AGAIN u32 OLDEST_GAUGES_SIGMA
2800 SEQ u32 OLDEST_GAUGES_U
2802 U f32x64 OLDEST_GAUGES_U
2930 SEQ_AGAIN u32 OLDEST_GAUGES_U
3000 SEQ u32 GAUGES_UNIT
3002 UNIT u16x64 GAUGES_UNIT
3066 SEQ_AGAIN u32 GAUGES_UNIT
3100 SEQ u32 GAUGES_LOW
3102 LOW f32x64 GAUGES_LOW
3230 SEQ_AGAIN u32 GAUGES_LOW
3300 SEQ u32 GAUGES_HIGH
3302 HIGH f32x64 GAUGES_HIGH
3430 SEQ_AGAIN u32 GAUGES_HIGH
4000 SEQ u32 GAUGES_NAME
4002 NAME ascii32x64 GAUGES_NAME
5026 SEQ_AGAIN u32 GAUGES_NAME";

/// The blocks that version 1.4 has added; none can be written.
const SERVED_1_4: [(&str, u16, u16); 14] = [
    ("GAUGES", 1100, 1183),
    ("GAUGES_VALUE", 1200, 1331),
    ("GAUGES_STEPS", 1400, 1531),
    ("GAUGES_SIGMA", 1600, 1731),
    ("GAUGES_U", 1800, 1931),
    ("OLDEST_GAUGES", 2100, 2183),
    ("OLDEST_GAUGES_VALUE", 2200, 2331),
    ("OLDEST_GAUGES_STEPS", 2400, 2531),
    ("OLDEST_GAUGES_SIGMA", 2600, 2731),
    ("OLDEST_GAUGES_U", 2800, 2931),
    ("GAUGES_UNIT", 3000, 3067),
    ("GAUGES_LOW", 3100, 3231),
    ("GAUGES_HIGH", 3300, 3431),
    ("GAUGES_NAME", 4000, 5027),
];

/// Name, first and last address of every block of version 1.3, and whether it can be written. All of them are
/// served.
const SERVED: [(&str, u16, u16, bool); 9] = [
    ("CONTROL", 0, 31, true),
    ("STATUS", 100, 131, false),
    ("RESULT", 200, 319, false),
    ("OLDEST", 400, 519, false),
    ("GAUGE_DETAIL", 520, 583, false),
    ("HEALTH", 600, 639, false),
    ("RECIPE_DIRECTORY", 700, 763, false),
    ("IDENTITY", 900, 939, false),
    ("GAUGE_UNCERTAINTY", 1000, 1069, false),
];

/// The beginnings of the meanings of rows whose meaning lists values.
const MEANINGS: [(u16, &str); 4] = [
    (
        2,
        "1-9999; 0 leave the recipe; 65535 select by PART_NUMBER; a trigger is accepted only if it is the active recipe, or 0",
    ),
    (
        120,
        "of the last rejected request: 1 not ready, 2 offline, 3 no recipe, 4 teach not allowed, 5 fault, 6 another recipe is active",
    ),
    (
        103,
        "0 temperature, 1 storage, 2 plc_lost, 3 clock_unsynced, 4 low_light, 5 saturation, 6 pattern_unfit, 7 frame_slip, 8 power, 9 geometry",
    ),
    (
        296,
        "0 pass, 1 valid, 2 low, 3 high, 4 doubtful (a limit lies within 2 sigma); 1 and 4 without 0, 2, 3",
    ),
];

fn row(address: u16) -> Register {
    let mut rows = registers().map(|(_, row)| row);
    rows.find(|row| row.address == address).expect("a row")
}

#[test]
fn what_is_added_says_more_of_four_rows_and_takes_nothing_back() {
    for (address, frozen) in MEANINGS {
        let meaning = row(address).meaning;
        assert!(meaning.starts_with(frozen), "{meaning}");
    }
}

#[test]
fn the_version_is_the_same_wherever_it_is_said() {
    let (major, minor) = (VERSION >> 8, VERSION & 0xFF);
    assert_eq!((major, minor), (1, 4));
    assert_eq!(row(121).meaning, format!("{VERSION:#06x}"));
    assert_eq!(registers_json()["version"], format!("{major}.{minor}"));
}

#[test]
fn every_block_of_version_1_is_served_where_it_was() {
    let added = SERVED_1_4.map(|(name, first, last)| (name, first, last, false));
    for (name, first, last, writable) in SERVED.into_iter().chain(added) {
        let (block, ..) = BLOCKS
            .iter()
            .find(|(block, ..)| block.name == name)
            .expect(name);
        assert_eq!(
            (block.first, block.last, block.writable, block.served),
            (first, last, writable, true),
            "{name}"
        );
    }
}

#[test]
fn version_1_of_the_map_is_frozen_word_for_word() {
    let rows: Vec<String> = registers_csv()
        .lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            format!(
                "{} {} {} {}",
                cells[0],
                cells[2],
                cells[3].replace(' ', ""),
                cells[6]
            )
        })
        .collect();
    let now: Vec<&str> = rows.iter().map(String::as_str).collect();
    for frozen in ROWS.lines().chain(ROWS_1_4.lines()) {
        assert!(
            now.contains(&frozen),
            "the row {frozen:?} is no longer in the map"
        );
    }
    assert_eq!(
        registers().count(),
        ROWS.lines().count() + ROWS_1_4.lines().count(),
        "a new row raises the version and gets a line here"
    );
}
