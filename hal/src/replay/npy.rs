//! NumPy arrays of two dimensions in `.npy` files: the three element types of a recording, read and written.
//!
//! Format: NumPy enhancement proposal 1 (versions 1.0, 2.0 and 3.0 of the header). Read here by hand, because
//! what arrives in a recording may be broken on purpose: the header is bounded and matched against the one
//! grammar NumPy writes, and nothing is allocated before the file's length is known to fit the shape.

use std::path::Path;

use super::failure::RecordingError;

/// Rows and columns, then the elements row by row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array<T> {
    pub rows: usize,
    pub columns: usize,
    pub elements: Vec<T>,
}

const MAGIC: &[u8] = b"\x93NUMPY";
/// NumPy aligns the start of the elements to this many bytes.
const ALIGNMENT: usize = 64;
/// NumPy's headers of plain arrays are below 128 bytes; anything far longer is not one.
const MAX_HEADER: usize = 4096;

struct Header<'a> {
    kind: &'a str,
    rows: usize,
    columns: usize,
    elements: &'a [u8],
}

/// `f32` elements.
pub(crate) fn read_f32(bytes: &[u8], path: &Path) -> Result<Array<f32>, RecordingError> {
    let header = header(bytes, path)?;
    let elements = match header.kind {
        "<f4" => of_size(&header, path)?
            .iter()
            .map(|b: &[u8; 4]| f32::from_le_bytes(*b))
            .collect(),
        other => return Err(wrong_kind(path, other, "f32 (<f4)")),
    };
    Ok(Array {
        rows: header.rows,
        columns: header.columns,
        elements,
    })
}

/// `f32` or `f64` elements, as `f64`.
pub(crate) fn read_f64(bytes: &[u8], path: &Path) -> Result<Array<f64>, RecordingError> {
    let header = header(bytes, path)?;
    let elements = match header.kind {
        "<f4" => of_size(&header, path)?
            .iter()
            .map(|b: &[u8; 4]| f64::from(f32::from_le_bytes(*b)))
            .collect(),
        "<f8" => of_size(&header, path)?
            .iter()
            .map(|b: &[u8; 8]| f64::from_le_bytes(*b))
            .collect(),
        other => return Err(wrong_kind(path, other, "f32 (<f4) or f64 (<f8)")),
    };
    Ok(Array {
        rows: header.rows,
        columns: header.columns,
        elements,
    })
}

/// `u8` elements.
pub(crate) fn read_u8(bytes: &[u8], path: &Path) -> Result<Array<u8>, RecordingError> {
    let header = header(bytes, path)?;
    let elements = match header.kind {
        "|u1" | "<u1" => of_size(&header, path)?
            .iter()
            .map(|b: &[u8; 1]| b[0])
            .collect(),
        other => return Err(wrong_kind(path, other, "u8 (|u1)")),
    };
    Ok(Array {
        rows: header.rows,
        columns: header.columns,
        elements,
    })
}

/// The bytes of a version 1.0 file; `elements` are little-endian already.
pub(crate) fn write(kind: &str, rows: usize, columns: usize, elements: &[u8]) -> Vec<u8> {
    let mut text =
        format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let preamble = MAGIC.len() + 4;
    // The header ends in a newline and is padded in front of it.
    let padded = (preamble + text.len() + 1).next_multiple_of(ALIGNMENT) - preamble;
    while text.len() + 1 < padded {
        text.push(' ');
    }
    text.push('\n');
    let mut bytes = Vec::with_capacity(preamble + padded + elements.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&u16::try_from(text.len()).unwrap_or(u16::MAX).to_le_bytes());
    bytes.extend_from_slice(text.as_bytes());
    bytes.extend_from_slice(elements);
    bytes
}

fn wrong_kind(path: &Path, found: &str, wanted: &str) -> RecordingError {
    RecordingError::content(
        path,
        format!("the array holds elements of type {found:?}, expected {wanted}"),
        "save the array with that type, little-endian",
    )
}

fn broken(path: &Path, problem: impl Into<String>) -> RecordingError {
    RecordingError::content(
        path,
        problem,
        "save the array again with numpy.save, row-major",
    )
}

/// The elements as a slice of byte groups, once their number is known to be rows × columns.
fn of_size<'a, const SIZE: usize>(
    header: &Header<'a>,
    path: &Path,
) -> Result<&'a [[u8; SIZE]], RecordingError> {
    let (groups, rest) = header.elements.as_chunks::<SIZE>();
    if !rest.is_empty() || header.rows.checked_mul(header.columns) != Some(groups.len()) {
        return Err(broken(
            path,
            format!(
                "the file holds {} bytes of elements, a {}×{} array of {SIZE}-byte elements needs another number",
                header.elements.len(),
                header.rows,
                header.columns
            ),
        ));
    }
    Ok(groups)
}

fn header<'a>(bytes: &'a [u8], path: &Path) -> Result<Header<'a>, RecordingError> {
    let rest = bytes
        .strip_prefix(MAGIC)
        .ok_or_else(|| broken(path, "not a NumPy array"))?;
    let (length, rest) = match rest {
        [1, 0, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, 0, a, b, 0, 0, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        _ => {
            return Err(broken(
                path,
                "the array's header has an unknown version or length",
            ));
        }
    };
    let (text, elements) = (length <= MAX_HEADER)
        .then(|| rest.split_at_checked(length))
        .flatten()
        .ok_or_else(|| broken(path, "the array's header is cut off"))?;
    let text =
        std::str::from_utf8(text).map_err(|_| broken(path, "the array's header is no text"))?;
    let unreadable = || {
        broken(
            path,
            format!("the array's header {:?} is not understood", text.trim_end()),
        )
    };
    match value_of(text, "'fortran_order':").ok_or_else(unreadable)? {
        order if order.starts_with("False") => {}
        _ => return Err(broken(path, "the array is stored column by column")),
    }
    let kind = value_of(text, "'descr':")
        .and_then(|rest| rest.strip_prefix('\'')?.split_once('\''))
        .map(|(kind, _)| kind)
        .ok_or_else(unreadable)?;
    let shape = value_of(text, "'shape':")
        .and_then(|rest| rest.strip_prefix('(')?.split_once(')'))
        .map(|(shape, _)| shape)
        .ok_or_else(unreadable)?;
    let sizes: Option<Vec<usize>> = shape
        .split(',')
        .map(str::trim)
        .filter(|size| !size.is_empty())
        .map(|size| size.parse().ok())
        .collect();
    match sizes.as_deref() {
        Some(&[rows, columns]) => Ok(Header {
            kind,
            rows,
            columns,
            elements,
        }),
        _ => Err(broken(
            path,
            format!("the array has shape ({shape}), expected rows and columns"),
        )),
    }
}

fn value_of<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.split_once(key).map(|(_, rest)| rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_written_here_is_read_by_another_library_and_by_this_one() {
        let elements = [1.5_f64, -2.0, f64::MAX, 0.0, 1e-300, 7.0];
        let bytes: Vec<u8> = elements.iter().flat_map(|e| e.to_le_bytes()).collect();
        let file = write("<f8", 2, 3, &bytes);
        let theirs = npyz::NpyFile::new(&file[..]).unwrap();
        assert_eq!(theirs.shape(), &[2, 3]);
        assert_eq!(theirs.into_vec::<f64>().unwrap(), elements);
        let ours = read_f64(&file, Path::new("x.npy")).unwrap();
        assert_eq!(
            (ours.rows, ours.columns, &ours.elements[..]),
            (2, 3, &elements[..])
        );
    }

    #[test]
    fn a_shape_that_overflows_or_does_not_fit_the_file_is_an_error() {
        for shape in [
            "18446744073709551615, 2",
            "99999999999999999999, 1",
            "2, 4",
            "6",
            "1, 2, 3",
            "",
        ] {
            let text =
                format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({shape}), }}\n");
            let mut file = b"\x93NUMPY\x01\x00".to_vec();
            file.extend_from_slice(&u16::try_from(text.len()).unwrap().to_le_bytes());
            file.extend_from_slice(text.as_bytes());
            file.extend_from_slice(&[0; 6]);
            assert!(read_u8(&file, Path::new("x.npy")).is_err(), "{shape}");
        }
    }
}
