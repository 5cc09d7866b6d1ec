//! Pure computation: frames in, verdict out.
#![no_std]
