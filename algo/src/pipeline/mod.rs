//! Whole frames: decoding, triangulation, heights about a known surface. Loops over rows run
//! serially or on a rayon pool, with the same bits.

mod cubic;
mod epipolar;
mod measure;
mod noise;
mod plate;
mod signal;
#[cfg(test)]
mod slips;

pub(crate) use cubic::{
    COMPARED, CubicInput, CubicOutput, CubicRow, HeightTally, NO_OFFSET, SIGMA, SQUARE,
    VARIANCE_UNIT_NM, offset_row, sum_variances,
};
pub use cubic::{HeightCubics, KnownSurface};
pub use epipolar::Epipolar;
pub use measure::{
    HeightMap, PhaseMap, Window, arrive, arrive_rest, decode, refuse_light_edges, triangulate,
    triangulate_with, wrapped,
};
pub use noise::{sample_noise, sine_residuals};
pub use plate::{Plate, PlateError};
pub use signal::{CLIPPED, mean_signal, signal, signal_by_modulation};

use crate::math::around;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicUsize, Ordering};
#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// Gets the share of a long computation that is done, from any of its threads and often; what it
/// does changes nothing of the result.
pub type Progress<'a> = &'a (dyn Fn(f64) + Sync);

/// Counts the rows that are done, in whatever order.
pub struct Done<'a> {
    progress: Progress<'a>,
    rows: usize,
    done: AtomicUsize,
}

impl<'a> Done<'a> {
    /// Of so many rows.
    pub fn new(progress: Progress<'a>, rows: usize) -> Self {
        Self {
            progress,
            rows,
            done: AtomicUsize::new(0),
        }
    }

    /// One row more is done.
    pub fn row(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done as f64 / self.rows.max(1) as f64);
    }
}

/// Calls `each` with every row of `map` (row-major, rows of `width`).
pub fn for_each_row<T: Send>(
    map: &mut [T],
    width: usize,
    each: impl Fn(usize, &mut [T]) + Sync + Send,
) {
    #[cfg(feature = "parallel")]
    map.par_chunks_mut(width.max(1))
        .enumerate()
        .for_each(|(v, row)| each(v, row));
    #[cfg(not(feature = "parallel"))]
    for (v, row) in map.chunks_mut(width.max(1)).enumerate() {
        each(v, row);
    }
}

/// Calls `each` with every item.
pub(crate) fn for_each_item<T: Send>(items: &mut [T], each: impl Fn(&mut T) + Sync + Send) {
    for_each_row(items, 1, |_, item| item.iter_mut().for_each(&each));
}

/// Calls `each` with every row of two maps (row-major), each given with the length of its rows.
pub(crate) fn for_each_row_of_two<T: Send, U: Send>(
    (first, first_length): (&mut [T], usize),
    (second, second_length): (&mut [U], usize),
    each: impl Fn(usize, &mut [T], &mut [U]) + Sync + Send,
) {
    let (first_length, second_length) = (first_length.max(1), second_length.max(1));
    #[cfg(feature = "parallel")]
    first
        .par_chunks_mut(first_length)
        .zip(second.par_chunks_mut(second_length))
        .enumerate()
        .for_each(|(v, (first, second))| each(v, first, second));
    #[cfg(not(feature = "parallel"))]
    for (v, (first, second)) in first
        .chunks_mut(first_length)
        .zip(second.chunks_mut(second_length))
        .enumerate()
    {
        each(v, first, second);
    }
}

/// Calls `each` with the index of every row and the row.
pub(crate) fn for_each<T: Send>(rows: Vec<T>, each: impl Fn(usize, T) + Sync + Send) {
    #[cfg(feature = "parallel")]
    rows.into_par_iter()
        .enumerate()
        .for_each(|(v, row)| each(v, row));
    #[cfg(not(feature = "parallel"))]
    for (v, row) in rows.into_iter().enumerate() {
        each(v, row);
    }
}

/// The values within `reach` pixels of each pixel along both axes, joined to one: along the rows
/// first, then along the columns. `join` is that of a lattice: in any order, and as often as wanted.
pub(crate) fn over_squares<T: Copy + Send + Sync>(
    values: &[T],
    width: usize,
    reach: usize,
    join: impl Fn(T, T) -> T + Send + Sync,
) -> Vec<T> {
    let rows = values.len() / width.max(1);
    let mut across = values.to_vec();
    for_each_row(&mut across, width, |row, out| {
        let line = &values[row * width..][..width];
        for (column, out) in out.iter_mut().enumerate() {
            let near = &line[around(column, reach, width)];
            *out = near.iter().fold(*out, |joined, here| join(joined, *here));
        }
    });
    let mut all = across.clone();
    for_each_row(&mut all, width, |row, out| {
        for other in around(row, reach, rows) {
            for (out, here) in out.iter_mut().zip(&across[other * width..]) {
                *out = join(*out, *here);
            }
        }
    });
    all
}

/// One value per row, in the order of the rows.
pub(crate) fn map_rows<R: Send>(rows: usize, each: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    return (0..rows).into_par_iter().map(each).collect();
    #[cfg(not(feature = "parallel"))]
    (0..rows).map(each).collect()
}
