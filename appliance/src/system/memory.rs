//! Gives the memory of large arrays back to the system when they are dropped.

/// Bytes from which on an array goes back to the system as soon as it is dropped.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE: libc::c_int = 1 << 20;

/// Makes large arrays go back to the system when they are dropped. By default the C library starts
/// to keep them after a few were dropped; a change of recipe would leave 50 MB behind. A trigger
/// allocates no large array, so it costs no time there.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(
    unsafe_code,
    reason = "the C library's setting has no safe wrapper that is kept"
)]
pub fn give_back() {
    // SAFETY: sets a number inside the allocator; valid at any time, from any thread.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE) };
}

/// Gives back what many small arrays have left behind.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(
    unsafe_code,
    reason = "the C library's function has no safe wrapper that is kept"
)]
pub fn trim() {
    // SAFETY: releases memory that nothing uses; valid at any time, from any thread.
    unsafe { libc::malloc_trim(0) };
}

/// Elsewhere the allocator's default holds.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back() {}

/// Elsewhere the allocator's default holds.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn trim() {}
