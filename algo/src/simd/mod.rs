//! Vector instructions behind one small trait, and the choice of the back-end that this machine
//! has.
//!
//! | file | what it has |
//! |---|---|
//! | `lanes` | `Lanes`, the operations on a block of pixels in which the kernels are written |
//! | `ssse3`, `avx2` | the back-ends of x86-64; `x86` has what both share |
//! | `neon` | the back-end of aarch64 |
//! | `portable` | plain code: the definition of each operation, for tests and other processors |
//! | `rows` | the rows that kernels read blocks from and write blocks to |
//!
//! All back-ends give the same bits. A value of a back-end proves that its instructions are
//! available, so its operations are safe to call. This is the only module with `unsafe`: intrinsics
//! that the proof covers, and loads and stores inside slices whose length has been asserted.
//!
//! Kernels are generic functions that are inlined into entry points compiled for the back-end's
//! instructions (`back_end_entry!`). They contain no closures, because those would be compiled
//! without these instructions.
#![allow(unsafe_code)]

mod lanes;
mod rows;
#[cfg(test)]
mod tests;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use lanes::{Lanes, MAX_PIXELS};
pub(crate) use rows::{Results, Rows, phase_bits};

/// A back-end of the phase kernels: the instructions that they are compiled for. All give the same
/// bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backend(pub(crate) Proof);

/// Defines [`Proof`] and what follows from it, from the slowest back-end on.
macro_rules! back_ends {
    ($($(#[$attribute:meta])* $module:ident :: $name:ident;)*) => {
        $($(#[$attribute])* mod $module; $(#[$attribute])* pub(crate) use $module::$name;)*

        /// A back-end and the proof that this machine has it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Proof {
            $($(#[$attribute])* $name($name),)*
        }

        impl Backend {
            /// The back-ends that this machine has, the fastest last.
            pub fn available() -> impl DoubleEndedIterator<Item = Self> {
                let all = [$($(#[$attribute])* $name::detect().map(|proof| Self(Proof::$name(proof))),)*];
                all.into_iter().flatten()
            }

            /// The word for reports: portable, ssse3, avx2 or neon.
            pub fn name(self) -> &'static str {
                match self.0 {
                    $($(#[$attribute])* Proof::$name(_) => stringify!($module),)*
                }
            }
        }
    };
}

back_ends! {
    // Plain code: the reference of the others in tests, and for processors without a back-end of
    // their own, or whose features cannot be detected.
    #[cfg(any(test, not(any(target_arch = "aarch64", all(target_arch = "x86_64", feature = "std")))))]
    portable::Portable;
    #[cfg(target_arch = "x86_64")]
    ssse3::Ssse3;
    #[cfg(target_arch = "x86_64")]
    avx2::Avx2;
    #[cfg(target_arch = "aarch64")]
    neon::Neon;
}

impl Backend {
    /// The reference of the others.
    #[cfg(test)]
    pub(crate) const PORTABLE: Self = Self(Proof::Portable(Portable));

    /// The fastest that this machine has; `None` on an x86-64 processor without SSSE3.
    pub fn best() -> Option<Self> {
        Self::available().next_back()
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
            #[cfg(any(test, not(all(target_arch = "x86_64", feature = "std"))))]
            #[inline(never)]
            fn plain<$($generics)*>(lanes: impl $crate::simd::Lanes, $($arg: $type),*) {
                $kernel(lanes, $($arg),*);
            }
            match backend.0 {
                #[cfg(any(test, not(any(target_arch = "aarch64", all(target_arch = "x86_64", feature = "std")))))]
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
