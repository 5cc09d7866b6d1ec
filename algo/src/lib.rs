//! From frames to a verdict: the pure computation of `fringed`.
//!
//! Everything here is a function of its arguments: no input or output, no clock, no randomness, no
//! global state. The per-pixel path from samples to absolute phase is integer arithmetic, but for
//! two places in `f32` with `+ − ×` (the threshold of modulation of weighted sums, and a single
//! level whose ratio is not 1). Geometry is `f64` with `+ − × ÷` and `libm`. So the same frames
//! give the same bits on every machine, with any number of threads.
//!
#![doc = include_str!("../README.md")]
#![no_std]

extern crate alloc;
#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod adaptive;
pub mod calibration;
pub mod chain;
pub mod flicker;
pub mod frame;
pub mod geometry;
pub mod inspect;
pub mod math;
pub mod pattern;
pub mod phase;
pub mod pipeline;
pub mod simd;
pub mod trust;
pub mod units;
