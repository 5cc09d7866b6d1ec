//! The system clock, and whether it is synchronised.

/// The time in µs since 1970 UTC, or `None` while no time service has synchronised the clock: a
/// time that may be wrong is worse than none.
pub fn utc_us() -> Option<u64> {
    if synchronised() {
        crate::station::system_utc_us()
    } else {
        None
    }
}

/// Whether the kernel says that the clock is disciplined by a time service.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "the kernel's word on the clock has no safe wrapper that is kept"
)]
fn synchronised() -> bool {
    let mut state = std::mem::MaybeUninit::<libc::timex>::zeroed();
    // SAFETY: `timex` is plain integers, for which zero is a value; with modes = 0 the call only
    // reads the clock's state and writes it into the struct that it is given.
    let answer = unsafe { libc::adjtimex(state.as_mut_ptr()) };
    answer >= 0 && answer != libc::TIME_ERROR
}

/// Elsewhere nothing is known of it.
#[cfg(not(target_os = "linux"))]
fn synchronised() -> bool {
    false
}
