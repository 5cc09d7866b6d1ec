//! All back-ends of this machine give the same bits.

use super::super::{Decoder, LeastModulation, PhaseRow, Trust};
use super::arrive;
use crate::frame::{FrameView, Samples};
use crate::pattern::{PhaseRange, Sequence, Shot};
use crate::simd::Backend;
use crate::units::{AbsolutePhase, Modulation};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec::Vec;

/// A decoded frame.
#[derive(Clone, PartialEq)]
struct Map {
    phase: Vec<AbsolutePhase>,
    modulation: Vec<Modulation>,
    trust: Vec<Trust>,
}

impl Map {
    fn new() -> Self {
        Self {
            phase: std::vec![AbsolutePhase::default(); WIDTH * HEIGHT],
            modulation: std::vec![Modulation::default(); WIDTH * HEIGHT],
            trust: std::vec![Trust::default(); WIDTH * HEIGHT],
        }
    }

    fn rows(&mut self) -> impl Iterator<Item = (usize, PhaseRow<'_>)> {
        let rows = self.phase.chunks_mut(WIDTH);
        let rows = rows.zip(self.modulation.chunks_mut(WIDTH));
        let rows = rows.zip(self.trust.chunks_mut(WIDTH));
        rows.enumerate().map(|(v, ((phase, modulation), trust))| {
            let row = PhaseRow {
                phase,
                modulation,
                trust,
            };
            (v, row)
        })
    }
}

const WIDTH: usize = 75;
const HEIGHT: usize = 4;

/// Frames of random samples, with dark and faint stretches and, of words, some of samples above
/// full scale.
fn frames(count: usize, depth: u8, random: &mut SplitMix64) -> Vec<Vec<u16>> {
    (0..count)
        .map(|_| {
            (0..WIDTH * HEIGHT)
                .map(|place| {
                    let x = random.next_u64() as u16;
                    match place / 40 % 4 {
                        0 => x >> (16 - depth) >> (depth - 3),
                        1 => x >> (16 - depth) >> 3,
                        3 if depth > 8 => x,
                        _ => x >> (16 - depth),
                    }
                })
                .collect()
        })
        .collect()
}

fn decode(decoder: &Decoder, samples: &[Vec<u16>], depth: u8, map: &[AbsolutePhase]) -> Map {
    let bytes: Vec<Vec<u8>> = samples
        .iter()
        .map(|frame| frame.iter().map(|&x| x as u8).collect())
        .collect();
    let views: Vec<_> = (0..samples.len())
        .map(|at| {
            let samples = match depth {
                8 => Samples::Eight(&bytes[at]),
                _ => Samples::Sixteen(&samples[at]),
            };
            FrameView::new(samples, WIDTH, HEIGHT, WIDTH).unwrap()
        })
        .collect();
    let mut arrived = decoder.arrived(WIDTH, HEIGHT);
    let level = |places: &[usize]| places.iter().map(|&place| views[place]).collect();
    let mut levels: Vec<Vec<_>> = decoder.levels().map(level).collect();
    let last = levels.pop().unwrap();
    for level in &levels {
        arrive(decoder, level, &mut arrived);
    }
    let mut found = Map::new();
    for (v, row) in found.rows() {
        let map = &map[v * WIDTH..(v + 1) * WIDTH];
        decoder.row(&arrived, &last, v, map, 0..WIDTH, row);
    }
    found
}

#[test]
fn every_back_end_gives_the_same_bits() {
    let mut random = SplitMix64::seed_from_u64(1);
    let ratios: [&[f64]; 5] = [
        &[0.009, 0.1, 1.0],
        &[0.0095, 0.55],
        &[5.0 / 6.0, 35.0 / 36.0, 1.0],
        &[0.8, 1.0],
        &[0.7],
    ];
    let range = PhaseRange {
        min: -3.0,
        max: 97.0,
    };
    for ratios in ratios {
        for steps in 3..=10 {
            for depth in [8, 10, 12, 13, 16] {
                let sequence: Vec<_> = ratios
                    .iter()
                    .flat_map(|&ratio| Shot::level(ratio, steps))
                    .collect();
                let sequence = Sequence::from_frames(&sequence).unwrap();
                let least = [16.0, 4.0, 9.0][random.next_u64() as usize % 3];
                let decoder = Decoder::new(&sequence, range, depth).unwrap();
                let decoder = decoder.with_least_modulation(LeastModulation::new(least).unwrap());
                let samples = frames(sequence.frame_count(), depth, &mut random);
                let map: Vec<_> = (0..WIDTH * HEIGHT)
                    .map(|place| match place % 41 {
                        0 => AbsolutePhase::UNKNOWN,
                        _ => AbsolutePhase::from_bits((random.next_u64() as i32) >> 9),
                    })
                    .collect();
                let mut expected = None;
                for backend in Backend::available() {
                    let decoder = decoder.clone().with_backend(backend);
                    let found = decode(&decoder, &samples, depth, &map);
                    let expected = expected.get_or_insert_with(|| found.clone());
                    assert!(
                        *expected == found,
                        "{} differs: ratios {ratios:?}, N = {steps}, {depth} bit",
                        backend.name()
                    );
                }
            }
        }
    }
}
