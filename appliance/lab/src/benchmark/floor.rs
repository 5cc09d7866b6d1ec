//! The floor: a loop that only reads twelve frames of 8 bits and writes one map of 32 bits.
//!
//! Every decoder reads and writes at least this, so none can be faster. Times are given as
//! multiples of the floor, which makes machines comparable. It is limited by memory: each block of
//! pixels is the exclusive or of twelve streams, and four copies of that, each combined with
//! another constant, are the bytes of the block's 32-bit values.

use super::effort::Effort;
use appliance::system::computing::timed;
use std::hint::black_box;

/// Frames that the floor reads.
const FRAMES: usize = 12;

/// Pixels of a block: one line of a cache.
const BLOCK: usize = 64;

/// Reads `frames` (of equal length) and writes `map`, a value for each pixel. Pixels after the last
/// whole block are left out.
fn floor(frames: &[&[u8]; FRAMES], map: &mut [[u8; 4]]) {
    let mut blocks = frames.map(|frame| frame.as_chunks::<BLOCK>().0.iter());
    let (out, _) = map.as_chunks_mut::<BLOCK>();
    for out in out {
        let mut mixed = [0_u8; BLOCK];
        for stream in &mut blocks {
            let Some(block) = stream.next() else { return };
            for (mixed, sample) in mixed.iter_mut().zip(block) {
                *mixed ^= sample;
            }
        }
        let out = out.as_flattened_mut();
        for (quarter, constant) in out.chunks_exact_mut(BLOCK).zip([0, 0x55, 0xAA, 0xFF]) {
            for (out, mixed) in quarter.iter_mut().zip(&mixed) {
                *out = mixed ^ constant;
            }
        }
    }
}

/// The memory that the floor reads and writes.
pub struct FloorSets {
    sets: Vec<(Vec<u8>, Vec<[u8; 4]>)>,
    pixels: usize,
}

impl FloorSets {
    /// As many copies as the effort asks for.
    pub fn new(effort: &Effort) -> Self {
        let pixels = effort.size.0 * effort.size.1;
        let bytes = FRAMES * pixels;
        let frames: Vec<u8> = (0..bytes).map(|at| (at * 7 + at / 251) as u8 | 1).collect();
        let copies = effort.bytes.div_ceil(bytes).max(1);
        Self {
            sets: vec![(frames, vec![[1; 4]; pixels]); copies],
            pixels,
        }
    }

    /// Processor time of one rotation, ns per pixel.
    pub fn time(&mut self) -> f64 {
        let pixels = self.pixels;
        let taken = timed(|| {
            for (frames, map) in &mut self.sets {
                let mut frames = frames.chunks(pixels);
                let frames = [(); FRAMES].map(|()| frames.next().unwrap_or_default());
                floor(&frames, map);
                black_box(map);
            }
        });
        taken.as_secs_f64() * 1e9 / (self.sets.len() * pixels).max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_reaches_the_map() {
        let mut samples = [[0_u8; 2 * BLOCK]; FRAMES];
        let map_of = |samples: &[[u8; 2 * BLOCK]; FRAMES]| {
            let mut map = [[1; 4]; 2 * BLOCK];
            floor(&samples.each_ref().map(|frame| &frame[..]), &mut map);
            map
        };
        let before = map_of(&samples);
        for frame in 0..FRAMES {
            for at in [0, 63, 64, 127] {
                samples[frame][at] = 7;
                assert_ne!(map_of(&samples), before, "{frame} {at}");
                samples[frame][at] = 0;
            }
        }
    }
}
