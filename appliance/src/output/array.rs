//! NumPy arrays.

use npyz::WriterBuilder;
use std::io;

/// A `.npy` file of one value per pixel, shape [rows, columns].
///
/// # Errors
/// Only if the number of values is not a multiple of `width` (as `InvalidInput`).
pub fn npy<T>(width: usize, values: &[T]) -> io::Result<Vec<u8>>
where
    T: npyz::AutoSerialize + Copy,
{
    let rows = values.len() / width.max(1);
    if rows * width != values.len() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("{} values are no rows of {width}", values.len()),
        ));
    }
    let mut bytes = Vec::with_capacity(128 + size_of_val(values));
    let mut writer = npyz::WriteOptions::<T>::new()
        .default_dtype()
        .shape(&[rows as u64, width as u64])
        .writer(&mut bytes)
        .begin_nd()?;
    writer.extend(values.iter().copied())?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::npy;

    #[test]
    fn an_array_keeps_its_shape_and_values() {
        let bytes = npy(3, &[1.0_f32, f32::NAN, 3.0, 4.0, 5.0, 6.0]).unwrap();
        let file = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(file.shape(), [2, 3]);
        let values: Vec<f32> = file.into_vec().unwrap();
        assert!(values[1].is_nan());
        assert_eq!(values[5], 6.0);
        assert!(npy(4, &[0.0_f32; 6]).is_err());
    }
}
