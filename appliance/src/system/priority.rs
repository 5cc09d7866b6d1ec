//! Work that the measuring task must not feel.

/// How far such a thread stands behind the others: a tenth of their share of a busy core.
#[cfg(target_os = "linux")]
const NICE: libc::c_int = 10;

/// Lets the calling thread stand behind all others of the program, also where a service manager has given the program a
/// real-time priority, which a new thread inherits.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "the calls that give up a thread's priority have no safe wrapper that is kept"
)]
pub fn give_way() {
    let ordinary = libc::sched_param { sched_priority: 0 };
    // SAFETY: both calls only read their arguments, and 0 names the calling thread. A thread may always give up priority.
    unsafe {
        libc::sched_setscheduler(0, libc::SCHED_BATCH, &raw const ordinary);
        libc::setpriority(libc::PRIO_PROCESS, 0, NICE);
    }
}

/// Elsewhere all threads are alike.
#[cfg(not(target_os = "linux"))]
pub fn give_way() {}
