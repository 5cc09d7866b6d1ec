//! Reading and writing two-dimensional NumPy arrays in `.npy` files.
//!
//! Format: NumPy enhancement proposal 1 (versions 1.0, 2.0 and 3.0 of the header). The parser is
//! written here because files in a recording or a recipe may be malformed on purpose: the header's
//! length is bounded, it must have the form that NumPy writes, and nothing is allocated before the
//! file's length is known to fit the shape.

use std::io::{self, Write};

/// Rows and columns, then the elements row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Array<T> {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// The elements, row by row.
    pub elements: Vec<T>,
}

/// An array that cannot be read, or is not of the expected kind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem}: {remedy}")]
pub struct NpyError {
    /// What is wrong, with the numbers.
    pub problem: String,
    /// What to do about it.
    pub remedy: &'static str,
}

/// A type of array element, stored little-endian.
pub trait Element: Copy {
    /// NumPy's name of the type that is written.
    const KIND: &'static str;
    /// Reads all elements of a file of type `kind`; `None` if this type cannot hold them.
    fn read(kind: &str, bytes: &[u8]) -> Option<Vec<Self>>;
    /// Appends the element's bytes.
    fn write(self, bytes: &mut Vec<u8>);
}

fn chunks<const SIZE: usize, T>(bytes: &[u8], from: impl Fn([u8; SIZE]) -> T) -> Vec<T> {
    let (groups, _) = bytes.as_chunks::<SIZE>();
    groups.iter().map(|group| from(*group)).collect()
}

impl Element for u8 {
    const KIND: &'static str = "|u1";
    fn read(kind: &str, bytes: &[u8]) -> Option<Vec<Self>> {
        matches!(kind, "|u1" | "<u1").then(|| bytes.to_vec())
    }
    fn write(self, bytes: &mut Vec<u8>) {
        bytes.push(self);
    }
}

macro_rules! elements {
    ($($type:ident = $kind:literal;)*) => {$(
        impl Element for $type {
            const KIND: &'static str = $kind;
            fn read(kind: &str, bytes: &[u8]) -> Option<Vec<Self>> {
                (kind == $kind).then(|| chunks(bytes, Self::from_le_bytes))
            }
            fn write(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

elements! {
    i16 = "<i2";
    f32 = "<f4";
}

/// Also reads files of `f32`.
impl Element for f64 {
    const KIND: &'static str = "<f8";
    fn read(kind: &str, bytes: &[u8]) -> Option<Vec<Self>> {
        match kind {
            "<f4" => Some(chunks(bytes, |group| Self::from(f32::from_le_bytes(group)))),
            "<f8" => Some(chunks(bytes, Self::from_le_bytes)),
            _ => None,
        }
    }
    fn write(self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&self.to_le_bytes());
    }
}

const MAGIC: &[u8] = b"\x93NUMPY";
/// NumPy aligns the start of the elements to this many bytes.
const ALIGNMENT: usize = 64;
/// Longest header that is read. NumPy's headers of plain arrays are shorter than 128 bytes.
const MAX_HEADER: usize = 4096;

/// Reads an array.
///
/// # Errors
/// If the bytes are not a two-dimensional row-major array of this type of element, or are cut off.
pub fn read<T: Element>(bytes: &[u8]) -> Result<Array<T>, NpyError> {
    let (kind, [rows, columns], elements) = header(bytes)?;
    // The last character of a kind is its size in bytes: "<f4".
    let size = kind
        .strip_prefix(['<', '|', '>', '='])
        .and_then(|kind| kind.get(1..)?.parse().ok());
    let expected = rows
        .checked_mul(columns)
        .zip(size)
        .and_then(|(count, size)| count.checked_mul(size));
    if expected != Some(elements.len()) {
        return Err(broken(format!(
            "the file holds {} bytes of elements, a {rows}×{columns} array of {kind:?} needs another number",
            elements.len(),
        )));
    }
    let elements = T::read(kind, elements).ok_or_else(|| NpyError {
        problem: format!(
            "the array holds elements of type {kind:?}, expected {:?}",
            T::KIND
        ),
        remedy: "save the array with that type, little-endian",
    })?;
    Ok(Array {
        rows,
        columns,
        elements,
    })
}

/// The bytes of a version 1.0 file with rows of `columns` elements; an incomplete last row is left
/// out.
pub fn write<T: Element>(columns: usize, elements: &[T]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(2 * ALIGNMENT + size_of_val(elements));
    // A vector takes everything.
    let _ = write_to(&mut bytes, columns, elements);
    bytes
}

/// Elements that are turned into bytes at a time.
const PIECE: usize = 16 << 10;

/// Writes what [`write()`] answers with, piece by piece.
///
/// # Errors
/// Whatever `out` answers.
pub fn write_to<T: Element>(
    out: &mut impl Write,
    columns: usize,
    elements: &[T],
) -> io::Result<()> {
    let rows = elements.len() / columns.max(1);
    out.write_all(&preamble(T::KIND, &format!("{rows}, {columns}")))?;
    let mut bytes = Vec::new();
    for piece in elements[..rows * columns].chunks(PIECE) {
        bytes.clear();
        piece.iter().for_each(|element| element.write(&mut bytes));
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// The bytes of a version 1.0 file that holds a text, as an array without dimensions.
pub fn write_text(text: &str) -> Vec<u8> {
    let length = text.chars().count();
    let mut bytes = preamble(&format!("<U{length}"), "");
    let letters = text.chars().map(|letter| u32::from(letter).to_le_bytes());
    bytes.extend(letters.flatten());
    bytes
}

/// What comes before the elements.
fn preamble(kind: &str, shape: &str) -> Vec<u8> {
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let preamble = MAGIC.len() + 4;
    // The header ends with a newline, and is padded with spaces before it.
    let padded = (preamble + text.len() + 1).next_multiple_of(ALIGNMENT) - preamble;
    while text.len() + 1 < padded {
        text.push(' ');
    }
    text.push('\n');
    let mut bytes = Vec::with_capacity(preamble + padded);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&u16::try_from(text.len()).unwrap_or(u16::MAX).to_le_bytes());
    bytes.extend_from_slice(text.as_bytes());
    bytes
}

fn broken(problem: impl Into<String>) -> NpyError {
    NpyError {
        problem: problem.into(),
        remedy: "save the array again with numpy.save, row-major",
    }
}

/// The kind of the elements, rows and columns, and the bytes of the elements.
fn header(bytes: &[u8]) -> Result<(&str, [usize; 2], &[u8]), NpyError> {
    let rest = bytes
        .strip_prefix(MAGIC)
        .ok_or_else(|| broken("not a NumPy array"))?;
    let (length, rest) = match rest {
        [1, 0, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        [2 | 3, 0, a, b, 0, 0, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
        _ => {
            return Err(broken(
                "the array's header has an unknown version or length",
            ));
        }
    };
    let (text, elements) = (length <= MAX_HEADER)
        .then(|| rest.split_at_checked(length))
        .flatten()
        .ok_or_else(|| broken("the array's header is cut off"))?;
    let text = std::str::from_utf8(text).map_err(|_| broken("the array's header is no text"))?;
    let unreadable = || {
        broken(format!(
            "the array's header {:?} is not understood",
            text.trim_end()
        ))
    };
    match value_of(text, "'fortran_order':").ok_or_else(unreadable)? {
        order if order.starts_with("False") => {}
        _ => return Err(broken("the array is stored column by column")),
    }
    let between = |key, open: char, close: char| {
        let rest = value_of(text, key)?.strip_prefix(open)?;
        rest.split_once(close).map(|(inner, _)| inner)
    };
    let kind = between("'descr':", '\'', '\'').ok_or_else(unreadable)?;
    let shape = between("'shape':", '(', ')').ok_or_else(unreadable)?;
    let sizes: Option<Vec<usize>> = shape
        .split(',')
        .map(str::trim)
        .filter(|size| !size.is_empty())
        .map(|size| size.parse().ok())
        .collect();
    match sizes.as_deref() {
        Some(&[rows, columns]) => Ok((kind, [rows, columns], elements)),
        _ => Err(broken(format!(
            "the array has shape ({shape}), expected rows and columns"
        ))),
    }
}

fn value_of<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.split_once(key).map(|(_, rest)| rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_written_as_the_proposal_says_and_read_here() {
        let elements = [1.5_f64, -2.0, f64::MAX, 0.0, 1e-300, 7.0];
        let file = write(3, &elements);
        // Version 1.0: a header that ends with a new line at a multiple of 64 bytes.
        let (start, rest) = file.split_at(10);
        assert_eq!(start[..8], *b"\x93NUMPY\x01\x00");
        let length = usize::from(u16::from_le_bytes([start[8], start[9]]));
        let (header, data) = rest.split_at(length);
        assert_eq!((start.len() + length) % 64, 0);
        let header = str::from_utf8(header).unwrap();
        assert!(header.ends_with('\n'));
        let said = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
        assert_eq!(header.trim_end(), said);
        assert_eq!(data, elements.map(f64::to_le_bytes).as_flattened());
        let ours = read::<f64>(&file).unwrap();
        assert_eq!(
            (ours.rows, ours.columns, &ours.elements[..]),
            (2, 3, &elements[..])
        );
        let whole = [i16::MIN, -1, 0, 0x0102];
        let file = write(2, &whole);
        assert!(file.ends_with(whole.map(i16::to_le_bytes).as_flattened()));
        assert_eq!(read::<i16>(&file).unwrap().elements, whole);
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
            assert!(read::<u8>(&file).is_err(), "{shape}");
        }
    }
}
