//! Tests of the phase kernels on single rows.

mod backends;
mod clipped;
mod eight_bit;
mod shifts;
mod textbook;
mod weights;

use super::arrived::{Arrived, ArrivedRow, WrappedRow};
use super::{Decoder, PhaseRow};
use crate::frame::{FrameView, Samples};
use crate::pattern::{PhaseRange, Sequence, Shot};
use crate::trust::Trust;
use crate::units::{AbsolutePhase, Modulation};
use core::f64::consts::TAU;
use std::vec::Vec;

const ONE_TURN: PhaseRange = PhaseRange { min: 0.0, max: 1.0 };

/// A decoder of one level with these shifts.
fn level(shifts: &[f64], depth: u8) -> Decoder {
    let shot = |&shift| Shot::sine(1.0, shift);
    let frames: Vec<_> = shifts.iter().map(shot).collect();
    Decoder::new(&Sequence::from_frames(&frames).unwrap(), ONE_TURN, depth).unwrap()
}

/// Decodes the next level on arrival.
fn arrive(decoder: &Decoder, frames: &[FrameView<'_>], arrived: &mut Arrived) {
    let level = arrived.levels();
    let (layout, words, bytes) = arrived.maps_mut();
    let bytes = bytes.chunks_mut(layout.bytes());
    let rows = words.chunks_mut(layout.words()).zip(bytes);
    for (v, (words, bytes)) in rows.enumerate() {
        decoder.arrive_row(level, frames, v, layout.row_mut(words, bytes));
    }
    arrived.add_level();
}

/// One demodulated row, and the modulations of its pixels that are trusted.
struct Demodulated(Arrived, Vec<Modulation>);

impl Demodulated {
    fn row(&self) -> WrappedRow<'_> {
        let ArrivedRow::Wrapped { levels, .. } = self.0.row(0) else {
            panic!("not about a map")
        };
        levels.part(0..self.1.len())
    }

    /// In counts; 0 where not trusted.
    fn modulation(&self, u: usize, full_scale: f64) -> f64 {
        f64::from(self.1[u].to_bits()) * full_scale / 65_535.0
    }
}

/// Demodulates one row; `rows` holds the samples of each frame.
fn wrap(decoder: &Decoder, depth: u8, rows: &[Vec<u16>]) -> Demodulated {
    let width = rows[0].len();
    let bytes: Vec<Vec<u8>> = rows.iter().map(|row| bytes_of(row)).collect();
    let places = decoder.levels().next().unwrap();
    let frames: Vec<_> = places
        .iter()
        .map(|&at| {
            let samples = match depth {
                8 => Samples::Eight(&bytes[at]),
                _ => Samples::Sixteen(&rows[at]),
            };
            FrameView::new(samples, width, 1, width).unwrap()
        })
        .collect();
    let mut arrived = Arrived::about_map(width, 1, 1);
    arrive(decoder, &frames, &mut arrived);
    let mut phase = std::vec![AbsolutePhase::from_bits(0); width];
    let mut modulation = std::vec![Modulation::default(); width];
    let mut trust = std::vec![Trust::default(); width];
    let map = phase.clone();
    let out = PhaseRow {
        phase: &mut phase,
        modulation: &mut modulation,
        trust: &mut trust,
    };
    let nothing = decoder.arrived(width, 1);
    decoder.row(&nothing, &frames, 0, &map, 0..width, out);
    Demodulated(arrived, modulation)
}

/// Samples of at most 8 bits as bytes.
fn bytes_of(row: &[u16]) -> Vec<u8> {
    row.iter().map(|&x| x as u8).collect()
}

/// φ in turns and B in counts by the definition.
fn by_definition(samples: &[u16], shifts: &[f64]) -> (f64, f64) {
    let (mut s, mut c) = (0.0, 0.0);
    for (&sample, &shift) in samples.iter().zip(shifts) {
        s += f64::from(sample) * libm::cos(TAU * shift);
        c += f64::from(sample) * libm::sin(TAU * shift);
    }
    let modulation = 2.0 / samples.len() as f64 * libm::sqrt(s * s + c * c);
    (libm::atan2(s, c) / TAU, modulation)
}

/// The error of a phase in turns, the short way round.
fn off(found: u16, turns: f64) -> f64 {
    let error = f64::from(found) / 65_536.0 - turns;
    error - libm::rint(error)
}
