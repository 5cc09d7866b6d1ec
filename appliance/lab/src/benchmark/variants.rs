//! Every variant that is timed, which is an implementation on a workload. New variants are added
//! here.

use super::decoding::Decoding;
use super::reference::Textbook;
use super::timing::Kernel;
use super::words;
use super::workload::{RANGE, Workload};
use algo::pattern::{PhaseRange, Sequence};
use algo::phase::{Decoder, LeastModulation};
use algo::simd::Backend;

/// The least modulation that a quiet head trusts, counts of 8 bits: 4.3 σ of a noise of 1.2 counts.
const QUIET_COUNTS: f64 = 5.0;

/// An implementation by its name.
pub type Named<N> = (N, Box<dyn Kernel>);

/// The decoder on each back-end of this machine, with the back-end's name.
///
/// # Errors
/// If the sequence cannot be decoded.
pub fn decoders(
    sequence: &Sequence,
    range: PhaseRange,
    bit_depth: u8,
) -> Result<Vec<(&'static str, Decoder)>, String> {
    let decoder = Decoder::new(sequence, range, bit_depth).map_err(words)?;
    Ok(Backend::available()
        .map(|backend| (backend.name(), decoder.clone().with_backend(backend)))
        .collect())
}

/// The textbook's decoder in both precisions.
///
/// # Errors
/// If the sequence cannot be decoded.
pub fn references(
    sequence: &Sequence,
    range: PhaseRange,
    bit_depth: u8,
    pixels: usize,
) -> Result<[Named<&'static str>; 2], String> {
    let double = Textbook::<f64>::new(sequence, range, bit_depth, pixels).map_err(words)?;
    let single = Textbook::<f32>::new(sequence, range, bit_depth, pixels).map_err(words)?;
    Ok([("f64", Box::new(double)), ("f32", Box::new(single))])
}

/// The decoders of a workload, by implementation and workload: `avx2_geometric_12`, a key in JSON.
/// Where the clock starts after the coarser levels were decoded, these are kept for `copies` frame
/// sets in turn.
///
/// # Errors
/// If its sequence cannot be decoded.
pub fn decoding(workload: &Workload, copies: usize) -> Result<Vec<Named<String>>, String> {
    let sequence = Sequence::from_frames(&workload.frames).map_err(words)?;
    let decoders = decoders(&sequence, RANGE, workload.bit_depth)?.into_iter();
    let named = decoders.flat_map(|(name, decoder)| of(workload, name, &decoder, copies));
    Ok(named.collect())
}

/// The fastest decoder with the least modulation of a quiet head: `avx2_geometric_12_quiet`.
///
/// # Errors
/// If its sequence cannot be decoded.
pub fn quiet(workload: &Workload, copies: usize) -> Result<Vec<Named<String>>, String> {
    let sequence = Sequence::from_frames(&workload.frames).map_err(words)?;
    let decoder = Decoder::new(&sequence, RANGE, workload.bit_depth).map_err(words)?;
    let least = LeastModulation::new(QUIET_COUNTS).ok_or("no least modulation of a quiet head")?;
    let decoder = decoder.with_least_modulation(least);
    let mut variants = of(workload, decoder.backend().name(), &decoder, copies);
    for (name, _) in &mut variants {
        name.push_str("_quiet");
    }
    Ok(variants)
}

/// A decoder of all levels, and of the last alone.
fn of(workload: &Workload, name: &str, decoder: &Decoder, copies: usize) -> Vec<Named<String>> {
    let mut variants: Vec<Named<String>> = Vec::new();
    if decoder.levels().len() > 1 && workload.has_references {
        let last = Decoding::after_the_last(decoder.clone(), copies);
        let name = format!("{name}_last_frames_of_{}", workload.name);
        variants.push((name, Box::new(last)));
    }
    let name = format!("{name}_{}", workload.name);
    variants.push((name, Box::new(Decoding::new(decoder.clone(), None))));
    variants
}

/// The references of a workload that has them, by implementation and workload: `f32_geometric_12`.
///
/// # Errors
/// If its sequence cannot be decoded.
pub fn textbooks(workload: &Workload, size: (usize, usize)) -> Result<Vec<Named<String>>, String> {
    if !workload.has_references {
        return Ok(Vec::new());
    }
    let sequence = Sequence::from_frames(&workload.frames).map_err(words)?;
    let both = references(&sequence, RANGE, workload.bit_depth, size.0 * size.1)?;
    let named = both.map(|(name, kernel)| (format!("{name}_{}", workload.name), kernel));
    Ok(named.into())
}
