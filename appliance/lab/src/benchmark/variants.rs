//! Every variant that is timed, which is an implementation on a workload. New variants are added here.

use super::decoding::Decoding;
use super::reference::Textbook;
use super::timing::Kernel;
use super::words;
use super::workload::{RANGE, Workload};
use algo::pattern::{PhaseRange, Sequence};
use algo::phase::Decoder;
use algo::simd::Backend;

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

/// The decoders of a workload, by implementation and workload: `avx2_geometric_12`, a key in JSON. Where the clock starts after the
/// coarser levels were decoded, these are kept for `copies` frame sets in turn.
///
/// # Errors
/// If its sequence cannot be decoded.
pub fn decoding(workload: &Workload, copies: usize) -> Result<Vec<Named<String>>, String> {
    let sequence = Sequence::from_frames(&workload.frames).map_err(words)?;
    let mut variants: Vec<Named<String>> = Vec::new();
    for (name, decoder) in decoders(&sequence, RANGE, workload.bit_depth)? {
        if decoder.levels().len() > 1 && workload.has_references {
            let last = Decoding::after_the_last(decoder.clone(), copies);
            let name = format!("{name}_last_frames_of_{}", workload.name);
            variants.push((name, Box::new(last)));
        }
        let name = format!("{name}_{}", workload.name);
        variants.push((name, Box::new(Decoding::new(decoder, None))));
    }
    Ok(variants)
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
