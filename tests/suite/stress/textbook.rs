//! With any number of shifts, depth, ratios, form, size and stride, decoding agrees with the
//! textbook.

use super::bounds::Tally;
use super::random::{Draw, KINDS, stack};
use tests::random::Random;

const SEED: u64 = 20_260_604;
/// Number of random stacks of each form.
const CASES: usize = 450;

#[test]
fn any_shifts_depth_ratios_size_and_stride_decode_as_the_textbook_says() {
    let mut random = Random::new(SEED);
    for kind in KINDS {
        let mut tally = Tally::default();
        for case in 0..CASES {
            let draw = Draw {
                kind,
                size: (1 + case % 70, 1 + random.below(4)),
                bit_depth: 8 + random.below(9) as u8,
                shifts: None,
            };
            let stack = stack(&mut random, draw);
            tally.add(&stack, &stack.decode());
        }
        tally.conclude(&format!("{kind:?}"));
    }
}

#[test]
fn every_number_of_shifts_at_every_depth_decodes_as_the_textbook_says() {
    let mut random = Random::new(SEED + 1);
    for kind in KINDS {
        let mut tally = Tally::default();
        for shifts in 3..=16 {
            for bit_depth in 8..=16 {
                let draw = Draw {
                    kind,
                    size: (67, 3),
                    bit_depth,
                    shifts: Some(shifts),
                };
                let stack = stack(&mut random, draw);
                tally.add(&stack, &stack.decode());
            }
        }
        tally.conclude(&format!("{kind:?}, every N and depth"));
    }
}

#[test]
fn large_frames_decode_as_the_textbook_says() {
    let mut random = Random::new(SEED + 2);
    let mut tally = Tally::default();
    for (kind, size) in KINDS
        .into_iter()
        .zip([(1001, 37), (640, 48), (4099, 5), (3, 2000)])
    {
        for (bit_depth, shifts) in [(8, 4), (8, 3), (12, 4)] {
            let draw = Draw {
                kind,
                size,
                bit_depth,
                shifts: Some(shifts),
            };
            let stack = stack(&mut random, draw);
            tally.add(&stack, &stack.decode());
        }
    }
    tally.conclude("large frames");
}
