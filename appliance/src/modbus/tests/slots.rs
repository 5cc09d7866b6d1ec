//! The 64 slots: blocks of all of them, and what a client that knows only the first 16 reads.

use super::*;
use crate::modbus::blocks::block_words;
use crate::modbus::map::{self, BLOCKS, Block};

const SEQ: u32 = 0x0001_0203;

/// What the gauge of a slot is decided to be, in turn: pass, too high, too low, doubtful, absent,
/// unseen.
fn gauge(slot: u16) -> GaugeValue {
    let value = match slot % 6 {
        0 => Some(0.5),
        1 => Some(f64::from(slot) + 1.0),
        2 => Some(-f64::from(slot) - 1.0),
        3 => Some(0.999),
        _ => None,
    };
    let measured = Measured {
        systematic: 0.003,
        absent: slot % 6 == 4,
        ..Measured::new(value, value.and(Some(0.004)))
    };
    let units = [Unit::Length, Unit::Angle, Unit::Volume, Unit::Share];
    let unit = units[usize::from(slot) % 4];
    let name = format!("gauge of slot {slot}, with a name that is long");
    GaugeValue::judged(slot, name, unit, measured, (Some(-1.0), Some(1.0)))
}

fn snapshot(slots: &[u16]) -> Snapshot {
    let inspection = Inspection {
        judged: Verdict::Fail,
        gauges: slots.iter().copied().map(gauge).collect(),
        ..Inspection::default()
    };
    let record = ResultRecord {
        seq: SEQ,
        token: 77,
        verdict: inspection.verdict(),
        inspection: Arc::new(inspection),
        ..ResultRecord::default()
    };
    let oldest = ResultRecord {
        seq: SEQ - 1,
        ..record.clone()
    };
    Snapshot {
        result: Some(Arc::new(record)),
        oldest: Some(Arc::new(oldest)),
        ..Station::new(settings(), Micros(0)).snapshot()
    }
}

fn words(snapshot: &Snapshot, block: &Block) -> Vec<u16> {
    block_words(snapshot, block, WordOrder::Normal)
}

fn all() -> Vec<u16> {
    (1..=64).collect()
}

/// Bit of a slot in four words.
fn bit(words: &[u16], slot: u16) -> bool {
    words[usize::from((slot - 1) / 16)] >> ((slot - 1) % 16) & 1 == 1
}

#[test]
fn the_bits_of_all_slots_are_those_of_their_decisions_and_empty_slots_have_none() {
    for slots in [all(), vec![1, 3, 64], vec![]] {
        let shown = snapshot(&slots);
        for (block, seq) in [(map::GAUGES, SEQ), (map::OLDEST_GAUGES, SEQ - 1)] {
            let words = words(&shown, &block);
            assert_eq!(
                (words.len(), u32_at(&words, 0), u32_at(&words, 82)),
                (84, seq, seq)
            );
            assert_eq!(
                (words[3], words[80], words[81]),
                (slots.last().copied().unwrap_or(0), 77, 0)
            );
            for slot in 1..=64 {
                let decision = match slots.contains(&slot) {
                    true => gauge(slot).decision,
                    false => Decision::default(),
                };
                let place = usize::from(slot) + 15;
                assert_eq!(words[place], decision.bits(), "slot {slot}");
                let bits = [4, 8, 12].map(|at| bit(&words[at..at + 4], slot));
                let failed = decision.low || decision.high || decision.absent;
                assert_eq!(bits, [decision.pass, decision.valid, failed], "slot {slot}");
            }
        }
    }
    assert_eq!(gauge(4).decision.bits(), 1 << 5, "absent");
}

#[test]
fn every_block_of_values_has_each_slot_in_its_place_and_both_numbers() {
    let slots = [1, 3, 12, 33, 64];
    let shown = snapshot(&slots);
    type Number = fn(&GaugeValue) -> Option<f64>;
    let floats: [(Block, Number); 7] = [
        (map::GAUGES_VALUE, |gauge| gauge.value),
        (map::GAUGES_SIGMA, |gauge| gauge.sigma),
        (map::GAUGES_U, |gauge| gauge.uncertainty),
        (map::OLDEST_GAUGES_VALUE, |gauge| gauge.value),
        (map::OLDEST_GAUGES_U, |gauge| gauge.uncertainty),
        (map::GAUGES_LOW, |gauge| gauge.low),
        (map::GAUGES_HIGH, |gauge| gauge.high),
    ];
    for (block, number) in floats {
        let words = words(&shown, &block);
        let seq = match block.name.starts_with("OLDEST") {
            true => SEQ - 1,
            false => SEQ,
        };
        assert_eq!(
            (words.len(), u32_at(&words, 0), u32_at(&words, 130)),
            (132, seq, seq)
        );
        for slot in 1..=64 {
            let own = slots.contains(&slot).then(|| gauge(slot));
            let expected = own
                .as_ref()
                .and_then(number)
                .map_or(0x7FC0_0000, |value| (value as f32).to_bits());
            assert_eq!(
                u32_at(&words, 2 * usize::from(slot)),
                expected,
                "{} {slot}",
                block.name
            );
        }
    }
    let steps = words(&shown, &map::GAUGES_STEPS);
    assert_eq!(u32_at(&steps, 2), 20_000, "2 mm in 0.1 µm");
    assert_eq!(u32_at(&steps, 4), 0x8000_0000);
    let unit = words(&shown, &map::GAUGES_UNIT);
    assert_eq!((unit[2], unit[3], unit[4], unit[65]), (2, 0, 4, 1));
    let name = words(&shown, &map::GAUGES_NAME);
    assert_eq!(
        (name.len(), u32_at(&name, 0), u32_at(&name, 1026)),
        (1028, SEQ, SEQ)
    );
    let text = |slot: usize| {
        let own = &name[16 * slot - 14..16 * slot + 2];
        let bytes = own.iter().flat_map(|word| word.to_be_bytes()).collect();
        String::from_utf8(bytes).unwrap()
    };
    assert_eq!(text(64), "gauge of slot 64, with a name th");
    assert_eq!(text(2), "\0".repeat(32));
}

#[test]
fn who_knows_only_16_slots_reads_what_a_recipe_with_only_those_would_give() {
    let (of_all, of_some) = (snapshot(&all()), snapshot(&[1, 3, 64]));
    let first: Vec<u16> = (1..=16).collect();
    for (shown, known) in [(of_all, &*first), (of_some, &[1, 3])] {
        let alone = snapshot(known);
        for block in [
            map::RESULT,
            map::OLDEST,
            map::GAUGE_DETAIL,
            map::GAUGE_UNCERTAINTY,
        ] {
            let (mut many, mut few) = (words(&shown, &block), words(&alone, &block));
            if [map::RESULT, map::OLDEST].contains(&block) {
                // VERDICT and FLAGS are of all slots.
                for place in [8, 31] {
                    (many[place], few[place]) = (0, 0);
                }
                assert_eq!(many[27], *known.last().unwrap());
            }
            assert_eq!(many, few, "{}", block.name);
        }
    }
    let result = words(&snapshot(&[1, 3, 64]), &map::RESULT);
    assert_eq!(
        (u32_at(&result, 34), u32_at(&result, 66), result[97]),
        (0x8000_0000, 0x7FC0_0000, 0)
    );
    let hidden = words(&snapshot(&[18, 19]), &map::RESULT);
    assert_eq!(
        (hidden[27], hidden[8]),
        (0, 2),
        "slots that are not shown count"
    );
}

#[test]
fn a_swapped_word_order_swaps_values_but_neither_bits_nor_text() {
    let shown = snapshot(&all());
    for (block, rows, _) in BLOCKS
        .iter()
        .filter(|(block, ..)| block.name.contains("GAUGES"))
    {
        let swapped = block_words(&shown, block, WordOrder::Swapped);
        let mut expected = words(&shown, block);
        for row in rows.iter().filter(|row| row.kind.width() == 2) {
            let first = usize::from(row.address - rows[0].address);
            for pair in expected[first..first + usize::from(row.count())].chunks_mut(2) {
                pair.swap(0, 1);
            }
        }
        assert_eq!(swapped, expected, "{}", block.name);
    }
}

#[tokio::test]
async fn gauges_is_one_read_and_longer_blocks_are_read_in_parts_within_their_ends() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    plc.write_single_register(1, 1).await.unwrap().unwrap();
    plant.work();
    let whole = plc.read_holding_registers(1100, 84).await.unwrap().unwrap();
    assert_eq!((whole.len(), whole[3]), (84, 2));
    assert_eq!(whole[16..18], [0b11, 0b110]);
    for (_, first, last) in [
        (0, 1200, 1331),
        (0, 1400, 1531),
        (0, 1600, 1731),
        (0, 1800, 1931),
    ] {
        let mut read = Vec::new();
        for (from, count) in [(first, 66), (first + 66, last - first - 65)] {
            read.extend(
                plc.read_input_registers(from, count)
                    .await
                    .unwrap()
                    .unwrap(),
            );
        }
        assert_eq!((u32_at(&read, 0), u32_at(&read, 130)), (1000, 1000));
        let refused = plc.read_input_registers(first, 126).await.unwrap();
        assert_eq!(refused, Err(Exception::IllegalDataValue));
        let refused = plc.read_input_registers(last, 2).await.unwrap();
        assert_eq!(refused, Err(Exception::IllegalDataAddress));
    }
    let mut names = Vec::new();
    for part in 0..9 {
        let first = 4000 + 115 * part;
        let count = 115.min(5028 - first);
        names.extend(
            plc.read_input_registers(first, count)
                .await
                .unwrap()
                .unwrap(),
        );
    }
    assert_eq!(
        (names.len(), u32_at(&names, 0), u32_at(&names, 1026)),
        (1028, 1000, 1000)
    );
    assert_eq!(names[2..4], [0x646F, 0x6D65], "dome");
}
