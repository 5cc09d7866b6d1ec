//! Every variant that is timed, which is an implementation on a workload. New variants are added here.

use super::decoding::Decoding;
use super::kernel::Kernel;
use super::reference::Textbook;
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

/// The variants of a workload, by implementation and workload: `f32_geometric_12`, a key in JSON.
///
/// # Errors
/// If its sequence cannot be decoded.
pub fn of(workload: &Workload, size: (usize, usize)) -> Result<Vec<Named<String>>, String> {
    let sequence = Sequence::from_frames(&workload.frames).map_err(words)?;
    let depth = workload.bit_depth;
    let mut variants = Vec::new();
    let mut push = |implementation: &str, kernel: Box<dyn Kernel>| {
        variants.push((format!("{implementation}_{}", workload.name), kernel));
    };
    for (name, decoder) in decoders(&sequence, RANGE, depth)? {
        if decoder.levels().len() > 1 && workload.has_references {
            let last = Decoding::after_the_last(decoder.clone());
            push(&format!("{name}_last_frames_of"), Box::new(last));
        }
        push(name, Box::new(Decoding::new(decoder, None)));
    }
    if workload.has_references {
        for (name, kernel) in references(&sequence, RANGE, depth, size.0 * size.1)? {
            push(name, kernel);
        }
    }
    Ok(variants)
}
