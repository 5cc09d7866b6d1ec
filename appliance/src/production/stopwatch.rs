//! Measures the processor time of a piece of work, on its own thread or on those of a pool.

use rayon::ThreadPool;
use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

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
