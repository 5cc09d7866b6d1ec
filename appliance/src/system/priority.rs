//! Priority of threads that must not slow the measuring task down.

/// Nice value of such a thread: on a busy core it gets a tenth of the share of another thread.
#[cfg(target_os = "linux")]
const NICE: libc::c_int = 10;

/// Lowers the calling thread's priority below that of the program's other threads, also where a service manager has given the
/// program a real-time priority, which a new thread inherits.
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

/// Elsewhere all threads have the same priority.
#[cfg(not(target_os = "linux"))]
pub fn give_way() {}
