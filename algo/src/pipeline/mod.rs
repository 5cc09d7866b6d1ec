//! Whole frames: decoding, triangulation, heights about a known surface. Rows run serially or on a
//! rayon pool, with the same bits.

mod cubic;
mod epipolar;
mod measure;
mod noise;
mod plate;
mod rays;
mod rows;
mod signal;
#[cfg(test)]
mod slips;
mod wrapped;

pub(crate) use cubic::{
    COMPARED, CubicInput, CubicOutput, CubicRow, HeightTally, NO_OFFSET, SIGMA, SQUARE,
    VARIANCE_UNIT_NM, offset_row, sum_variances,
};
pub use cubic::{HeightCubics, KnownSurface};
pub use epipolar::Epipolar;
pub use measure::{
    HeightMap, PhaseMap, Window, arrive, arrive_rest, decode, triangulate, triangulate_with,
};
pub use noise::{off_sine, sample_noise, signal_by_modulation};
pub use plate::{Plate, PlateError};
pub use rows::{Done, Progress, for_each_row};
pub(crate) use rows::{for_each, for_each_item, for_each_row_of_two, map_rows};
pub use signal::{mean_signal, signal};
pub use wrapped::wrapped;
