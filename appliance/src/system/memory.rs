//! What the program does with memory that it no longer needs.

/// Arrays of this many bytes are given back to the system as soon as they are dropped.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE: libc::c_int = 1 << 20;

/// Gives large arrays back to the system when they are dropped. By itself the C library keeps them once a few were dropped,
/// and a change of recipe would leave its 50 MB of arrays behind; a trigger makes no large array.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[expect(
    unsafe_code,
    reason = "the C library's setting has no safe wrapper that is kept"
)]
pub fn give_back() {
    // SAFETY: sets a number inside the allocator; valid at any time, from any thread.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE) };
}

/// Elsewhere the C library does as it likes.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back() {}
