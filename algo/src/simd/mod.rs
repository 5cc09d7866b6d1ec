//! Vector instructions behind one small trait, and the choice of the back-end that this machine
//! has.
//!
//! The phase kernels are written in the operations of `Lanes`. `Portable` defines them as plain
//! code; `Avx2`, `Ssse3` and `Neon` give the same results by vector instructions. A value of a
//! back-end proves that its instructions are available, so its operations are safe to call. This is
//! the only module with `unsafe`: intrinsics that the proof covers, and loads and stores inside
//! slices whose length has been asserted.
//!
//! Kernels are generic functions that are inlined into entry points compiled for the back-end's
//! instructions (`back_end_entry!`). They contain no closures, because those would be compiled
//! without these instructions.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
mod lanes;
#[cfg(target_arch = "aarch64")]
mod neon;
pub(crate) mod plain;
mod portable;
mod results;
mod rows;
#[cfg(target_arch = "x86_64")]
mod ssse3;
#[cfg(test)]
mod tests;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
pub(crate) use lanes::{LINE, Lanes, MAX_PIXELS};
#[cfg(target_arch = "aarch64")]
pub(crate) use neon::Neon;
pub(crate) use portable::Portable;
pub(crate) use results::Results;
pub(crate) use rows::Rows;
#[cfg(target_arch = "x86_64")]
pub(crate) use ssse3::Ssse3;

/// A back-end of the phase kernels: the instructions that they are compiled for. All give the same
/// bits.
#[derive(Clone, Copy, Debug)]
pub struct Backend(pub(crate) Proof);

/// A back-end and the proof that this machine has it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Proof {
    /// Plain code.
    Portable(Portable),
    /// x86-64 with SSSE3.
    #[cfg(target_arch = "x86_64")]
    Ssse3(Ssse3),
    /// x86-64 with AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// aarch64.
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
}

impl Backend {
    /// Plain code on arrays: slow, and the oracle of the others.
    pub const PORTABLE: Self = Self(Proof::Portable(Portable));

    /// The back-ends that this machine has, the fastest last.
    pub fn available() -> impl Iterator<Item = Self> {
        let all = [
            Some(Self::PORTABLE),
            #[cfg(target_arch = "x86_64")]
            Ssse3::detect().map(|proof| Self(Proof::Ssse3(proof))),
            #[cfg(target_arch = "x86_64")]
            Avx2::detect().map(|proof| Self(Proof::Avx2(proof))),
            #[cfg(target_arch = "aarch64")]
            Some(Self(Proof::Neon(Neon))),
        ];
        all.into_iter().flatten()
    }

    /// The fastest that this machine has.
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::PORTABLE)
    }

    /// The word for reports: portable, ssse3, avx2 or neon.
    pub fn name(self) -> &'static str {
        match self.0 {
            Proof::Portable(_) => "portable",
            #[cfg(target_arch = "x86_64")]
            Proof::Ssse3(_) => "ssse3",
            #[cfg(target_arch = "x86_64")]
            Proof::Avx2(_) => "avx2",
            #[cfg(target_arch = "aarch64")]
            Proof::Neon(_) => "neon",
        }
    }
}

/// Makes the compiler align the stack of the function that this is inlined into to a line of the
/// cache. By itself it does not align the stack for vectors that it later finds no register for;
/// where such a vector lies across the border of two pages, a kernel takes twice as long.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(crate) fn align_stack() {
    #[repr(align(64))]
    struct Line(u8);
    let line = Line(0);
    core::hint::black_box(&line.0);
}

/// Defines `fn name(backend: Backend, arguments)`, which runs the generic `kernel(lanes,
/// arguments)` compiled for that back-end's instructions.
macro_rules! back_end_entry {
    ($(#[$doc:meta])* fn $name:ident [$($generics:tt)*] = $kernel:ident ( $($arg:ident : $type:ty),* $(,)? )) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments, unsafe_code)]
        pub(crate) fn $name<$($generics)*>(backend: $crate::simd::Backend, $($arg: $type),*) {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "ssse3")]
            #[inline(never)]
            fn ssse3<$($generics)*>(lanes: $crate::simd::Ssse3, $($arg: $type),*) {
                $kernel(lanes, $($arg),*);
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            #[inline(never)]
            fn avx2<$($generics)*>(lanes: $crate::simd::Avx2, $($arg: $type),*) {
                $crate::simd::align_stack();
                $kernel(lanes, $($arg),*);
            }
            #[inline(never)]
            fn plain<$($generics)*>(lanes: impl $crate::simd::Lanes, $($arg: $type),*) {
                $kernel(lanes, $($arg),*);
            }
            match backend.0 {
                $crate::simd::Proof::Portable(lanes) => plain(lanes, $($arg),*),
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Proof::Ssse3(lanes) => {
                    // SAFETY: an `Ssse3` exists only where the processor has SSSE3.
                    unsafe { ssse3(lanes, $($arg),*) }
                }
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Proof::Avx2(lanes) => {
                    // SAFETY: an `Avx2` exists only where the processor has AVX2.
                    unsafe { avx2(lanes, $($arg),*) }
                }
                #[cfg(target_arch = "aarch64")]
                $crate::simd::Proof::Neon(lanes) => plain(lanes, $($arg),*),
            }
        }
    };
}
pub(crate) use back_end_entry;
