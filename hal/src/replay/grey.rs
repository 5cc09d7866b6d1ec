//! Grey PNG files of 8 and 16 bits: one camera frame each.

use std::io::Cursor;

use png::{BitDepth, ColorType};

use super::Wrong;
use crate::frame::{FrameFormat, Pixels, Samples};

/// Bytes that the decoder may allocate in addition to the samples.
const DECODER_BYTES: usize = 64 << 20;

/// Decodes the PNG in `bytes`, which must be grey, complete, and of exactly `format`.
///
/// # Errors
/// What is wrong: not a PNG, cut off, colour, another size or depth, or a sample
/// above 2^bits − 1.
pub(crate) fn decode(bytes: &[u8], format: &FrameFormat) -> Result<Pixels, Wrong> {
    let broken = |error: png::DecodingError| {
        Wrong::new(
            format!("the picture cannot be decoded ({error})"),
            "copy the file again, it is cut off or damaged",
        )
    };
    let limits = png::Limits {
        bytes: DECODER_BYTES,
    };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().map_err(broken)?;

    let (width, height) = reader.info().size();
    if (width, height) != (format.width, format.height) {
        return Err(Wrong::new(
            format!(
                "expected {}×{} pixels, got {width}×{height}",
                format.width, format.height
            ),
            "correct the camera's size in recording.json or replace the frame",
        ));
    }
    let wanted = if format.bit_depth == 8 {
        BitDepth::Eight
    } else {
        BitDepth::Sixteen
    };
    let found = reader.info().bit_depth;
    let colour = reader.info().color_type;
    if colour != ColorType::Grayscale || found != wanted || reader.info().is_animated() {
        return Err(Wrong::new(
            format!(
                "expected a still grey picture of {} bits for a camera of {} bits, got {colour:?} of {} bits",
                wanted as u8, format.bit_depth, found as u8
            ),
            "correct camera.bit_depth in recording.json or save the frame as grey",
        ));
    }

    let size = format.samples() * if format.bit_depth == 8 { 1 } else { 2 };
    if reader.output_buffer_size() != Some(size) {
        return Err(Wrong::new(
            format!("the picture does not hold {size} bytes of samples"),
            "save the frame again",
        ));
    }
    let mut raw = vec![0_u8; size];
    reader.next_frame(&mut raw).map_err(broken)?;
    // Reads on to the end chunk, so that a file that is cut off after its samples is refused too.
    reader.finish().map_err(broken)?;

    if format.bit_depth == 8 {
        return Ok(Pixels::Eight(raw));
    }
    let (pairs, _) = raw.as_chunks::<2>();
    let samples: Vec<u16> = pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect();
    match samples.iter().max() {
        Some(&largest) if largest > format.full_scale() => Err(Wrong::new(
            format!(
                "holds the sample {largest}, a camera of {} bits gives at most {}",
                format.bit_depth,
                format.full_scale()
            ),
            "correct camera.bit_depth in recording.json; samples are stored as they are, not scaled",
        )),
        _ => Ok(Pixels::Sixteen(samples)),
    }
}

/// Encodes samples of `format` as PNG; padding between rows is left out.
///
/// # Errors
/// The encoder's error.
pub(crate) fn encode(
    format: &FrameFormat,
    samples: Samples<'_>,
) -> Result<Vec<u8>, png::EncodingError> {
    let width = format.width as usize;
    let mut raw = Vec::with_capacity(format.samples() * 2);
    let depth = match samples {
        Samples::Eight(samples) => {
            for row in samples.chunks(format.stride) {
                raw.extend(row.iter().take(width));
            }
            BitDepth::Eight
        }
        Samples::Sixteen(samples) => {
            for row in samples.chunks(format.stride) {
                raw.extend(
                    row.iter()
                        .take(width)
                        .flat_map(|sample| sample.to_be_bytes()),
                );
            }
            BitDepth::Sixteen
        }
    };
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, format.width, format.height);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&raw)?;
    writer.finish()?;
    Ok(file)
}
