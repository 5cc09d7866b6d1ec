//! A pixel's result depends only on its samples: not on its place, the width of its row, the
//! stride, or its neighbours.

use super::random::{Draw, KINDS, stack};
use super::stack::{Stack, shots};
use algo::pipeline::PhaseMap;
use algo::units::{AbsolutePhase, Modulation};
use std::ops::Range;
use tests::random::Random;

const SEED: u64 = 20_260_605;
/// Bit depths and shifts with special kernels, and others.
const VARIANTS: [(u8, Option<usize>); 5] = [
    (8, Some(4)),
    (8, Some(3)),
    (12, Some(4)),
    (8, None),
    (16, None),
];

/// The results of a pixel, bit by bit.
fn bits(map: &PhaseMap, pixel: usize) -> (i32, u16, u8) {
    (
        map.phase[pixel].to_bits(),
        map.modulation[pixel].to_bits(),
        map.trust[pixel] as u8,
    )
}

/// `inner` within a larger frame with random samples elsewhere.
fn embedded(random: &mut Random, inner: &Stack, (left, top): (usize, usize)) -> Stack {
    let size = (
        left + inner.width + random.below(40),
        top + inner.height + random.below(3),
    );
    let range = (inner.range.min, inner.range.max);
    let mut outer = Stack::dark(size, inner.bit_depth, inner.frames.clone(), range);
    let stride = outer.width + random.below(70);
    outer = outer.with_stride(stride);
    outer.least = inner.least;
    // Random light, or none, around it.
    let full = usize::from(inner.full_scale());
    let dark = random.below(2) == 0;
    outer.fill(|_, _| {
        if dark {
            0
        } else {
            random.below(full + 1) as u16
        }
    });
    let mut map = vec![AbsolutePhase::from_turns(1.0); outer.pixels()];
    for pixel in 0..inner.pixels() {
        let at = place(inner, &outer, (left, top), pixel);
        for frame in 0..inner.frames.len() {
            outer.set(frame, at, inner.sample(frame, pixel));
        }
        if let Some(known) = &inner.map {
            map[at] = known[pixel];
        }
    }
    outer.map = inner.map.as_ref().map(|_| map);
    outer
}

fn place(inner: &Stack, outer: &Stack, (left, top): (usize, usize), pixel: usize) -> usize {
    (top + pixel / inner.width) * outer.width + left + pixel % inner.width
}

#[test]
fn the_same_samples_give_the_same_bits_at_any_place_in_a_frame_of_any_size() {
    let mut random = Random::new(SEED);
    let mut resolved = 0;
    for width in 1..=70 {
        for (variant, (bit_depth, shifts)) in VARIANTS.into_iter().enumerate() {
            let kind = KINDS[(width + variant) % 4];
            let size = (width, 1 + random.below(3));
            let draw = Draw {
                kind,
                size,
                bit_depth,
                shifts,
            };
            let inner = stack(&mut random, draw);
            let alone = inner.decode();
            let corner = (random.below(71), random.below(3));
            let outer = embedded(&mut random, &inner, corner);
            let within = outer.decode();
            for pixel in 0..inner.pixels() {
                let at = place(&inner, &outer, corner, pixel);
                assert_eq!(
                    bits(&alone, pixel),
                    bits(&within, at),
                    "{draw:?}, pixel {pixel} moved by {corner:?}"
                );
            }
            resolved += alone.phase.iter().filter(|phase| phase.is_known()).count();
        }
    }
    println!("{resolved} resolved pixels moved");
    assert!(resolved > 10_000, "{resolved}");
}

#[test]
fn what_is_looked_at_does_not_change_what_is_seen() {
    let mut random = Random::new(SEED + 1);
    for case in 0..60 {
        let (bit_depth, shifts) = VARIANTS[case % VARIANTS.len()];
        let draw = Draw {
            kind: KINDS[case % 4],
            size: (1 + random.below(90), 6),
            bit_depth,
            shifts,
        };
        let stack = stack(&mut random, draw);
        let whole = stack.decode();
        let mut window: Vec<Range<usize>> = (0..6)
            .map(|_| {
                let start = random.below(stack.width + 1);
                start..start + random.below(stack.width + 1 - start)
            })
            .collect();
        let nothing = random.below(stack.width + 1);
        window[3] = nothing..nothing;
        let part = stack.decode_in(Some(&window));
        for pixel in 0..stack.pixels() {
            let (row, column) = (pixel / stack.width, pixel % stack.width);
            if window[row].contains(&column) {
                assert_eq!(bits(&whole, pixel), bits(&part, pixel), "{draw:?}, {pixel}");
            }
            if window[row].is_empty() {
                assert_eq!(part.phase[pixel], AbsolutePhase::UNKNOWN);
                assert_eq!(part.modulation[pixel], Modulation::default());
            }
        }
    }
}

#[test]
fn frames_without_pixels_decode_to_nothing() {
    for size in [(0, 0), (0, 3), (3, 0)] {
        let frames = shots(&[0.01, 0.1, 1.0], 4);
        let stack = Stack::dark(size, 8, frames, (0.0, 90.0));
        assert!(stack.decode().phase.is_empty());
    }
}
