//! What computing takes of the machine: processor time, memory that is given back, and whether the
//! measuring task only computes.

use rayon::ThreadPool;
use rustix::time::{ClockId, clock_gettime};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Set by the measuring task, read when the program stops. Cheap to clone; clones share the flag.
#[derive(Clone, Debug, Default)]
pub struct Computing(Arc<AtomicBool>);

impl Computing {
    /// Runs work that takes seconds and whose result is not needed once the program ends.
    pub fn on<T>(&self, work: impl FnOnce() -> T) -> T {
        self.0.store(true, Ordering::Relaxed);
        let result = work();
        self.0.store(false, Ordering::Relaxed);
        result
    }

    /// Whether such work is under way.
    pub fn is_under_way(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Runs `work` and returns the processor time that this thread spent on it. Time in which another
/// thread had the core does not count.
pub fn timed(work: impl FnOnce()) -> Duration {
    let began = now();
    work();
    now().saturating_sub(began)
}

/// Runs `work` on `pool` and returns its result and the processor time of all threads of the pool
/// meanwhile. On a pool of several threads this includes their search for work.
pub fn timed_on<T: Send>(pool: &ThreadPool, work: impl FnOnce() -> T + Send) -> (T, Duration) {
    let spent = || pool.broadcast(|_| now()).into_iter().sum::<Duration>();
    let began = spent();
    let done = pool.install(work);
    (done, spent().saturating_sub(began))
}

fn now() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    // Processor time is never negative.
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_work_takes_processor_time() {
        let slept = timed(|| std::thread::sleep(Duration::from_millis(30)));
        let worked = timed(|| {
            let began = std::time::Instant::now();
            while began.elapsed() < Duration::from_millis(2) {
                std::hint::spin_loop();
            }
        });
        assert!(slept < Duration::from_millis(15), "{slept:?}");
        assert!(worked > Duration::ZERO);
    }

    #[test]
    fn work_on_a_pool_is_timed_on_the_threads_that_do_it() {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(2)
            .build()
            .unwrap();
        let busy = || {
            timed(|| {
                std::hint::black_box((0..10_000_000_u64).map(std::hint::black_box).sum::<u64>());
            })
        };
        let ((one, other), spent) = timed_on(&pool, || rayon::join(busy, busy));
        // Each half by the clock of the thread that did it: a busy machine makes both sides longer.
        assert!(spent >= one + other, "{spent:?} for {one:?} and {other:?}");
        assert!(!one.is_zero() && !other.is_zero());
    }
}
