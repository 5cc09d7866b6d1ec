//! What computing takes of the machine: priorities of threads, processor time, memory that is given
//! back, and whether the measuring task only computes.

use rayon::ThreadPool;
use rustix::time::{ClockId, clock_gettime};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Whether the measuring task only computes: it then uses no device and stores nothing, so the program
/// may end without waiting for it. Cheap to clone; clones share the flag.
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
    let began = thread_time();
    work();
    thread_time().saturating_sub(began)
}

/// Runs `work` on `pool` and returns its result and the processor time of all threads of the pool
/// meanwhile. On a pool of several threads this includes their search for work.
pub fn timed_on<T: Send>(pool: &ThreadPool, work: impl FnOnce() -> T + Send) -> (T, Duration) {
    let spent = || {
        pool.broadcast(|_| thread_time())
            .into_iter()
            .sum::<Duration>()
    };
    let began = spent();
    let done = pool.install(work);
    (done, spent().saturating_sub(began))
}

/// Processor time of the calling thread.
fn thread_time() -> Duration {
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
pub fn trim_memory() {
    // SAFETY: releases memory that nothing uses; valid at any time, from any thread.
    unsafe { libc::malloc_trim(0) };
}

/// Elsewhere the allocator's default holds.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back() {}

/// Elsewhere the allocator's default holds.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn trim_memory() {}

/// Nice value of a thread that must not slow others down: on a busy core it gets a tenth of the
/// share of another thread.
#[cfg(target_os = "linux")]
const NICE: libc::c_int = 10;
/// Real-time priority of a thread that must not be late: above all ordinary threads, below the
/// kernel's handlers of interrupts (50).
#[cfg(target_os = "linux")]
const PROMPT: libc::c_int = 20;

/// What the system granted to a thread that must not be late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Prompt {
    /// A real-time priority.
    pub real_time: bool,
    /// The core that it has for itself.
    pub core: Option<usize>,
}

/// Lowers the calling thread's priority below that of the program's other threads, also where a
/// service manager has given the program a real-time priority, which a new thread inherits.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "the calls that give up a thread's priority have no safe wrapper that is kept"
)]
pub fn give_way() {
    let ordinary = libc::sched_param { sched_priority: 0 };
    // SAFETY: both calls only read their arguments, and 0 names the calling thread. A thread may
    // always give up priority.
    unsafe {
        libc::sched_setscheduler(0, libc::SCHED_BATCH, &raw const ordinary);
        libc::setpriority(libc::PRIO_PROCESS, 0, NICE);
    }
}

/// Elsewhere all threads have the same priority.
#[cfg(not(target_os = "linux"))]
pub fn give_way() {}

/// Lets the calling thread run only where a core has nothing else to do: beside busy ones it gets
/// 0.3 % of a core (`SCHED_IDLE`, sched(7)).
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "the call that gives up a thread's priority has no safe wrapper that is kept"
)]
pub fn stand_back() {
    let ordinary = libc::sched_param { sched_priority: 0 };
    // SAFETY: the call only reads its arguments, and 0 names the calling thread.
    unsafe {
        libc::sched_setscheduler(0, libc::SCHED_IDLE, &raw const ordinary);
    }
}

/// Elsewhere all threads have the same priority.
#[cfg(not(target_os = "linux"))]
pub fn stand_back() {}

/// Gives the calling thread a real-time priority, and `core` if there is one that the kernel keeps
/// free of other work, as far as the system permits: `LimitRTPRIO=` of the service. Otherwise the
/// thread goes on as it is.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "the call that sets a thread's scheduling policy has no safe wrapper that is kept"
)]
pub fn be_prompt(core: Option<usize>) -> Prompt {
    let prompt = libc::sched_param {
        sched_priority: PROMPT,
    };
    // SAFETY: the call only reads its arguments, and 0 names the calling thread.
    let refused = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const prompt) };
    let core = core.filter(|core| {
        let mut only = rustix::thread::CpuSet::new();
        *core < rustix::thread::CpuSet::MAX_CPU && {
            only.set(*core);
            rustix::thread::sched_setaffinity(None, &only).is_ok()
        }
    });
    Prompt {
        real_time: refused == 0,
        core,
    }
}

/// Elsewhere all threads have the same priority.
#[cfg(not(target_os = "linux"))]
pub fn be_prompt(_: Option<usize>) -> Prompt {
    Prompt::default()
}

/// What the thread that ends the trigger's pulses gets on this computer.
pub fn prompt(core: Option<usize>) -> Prompt {
    let tried = std::thread::spawn(move || be_prompt(core)).join();
    tried.unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Condvar, Mutex};
    use std::time::{Duration, Instant};

    #[test]
    fn only_work_takes_processor_time() {
        let slept = timed(|| std::thread::sleep(Duration::from_millis(30)));
        let worked = timed(|| {
            let began = Instant::now();
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

    const WIDTH: Duration = Duration::from_micros(16_653);
    /// Half a percent of it.
    const SPOILED: Duration = Duration::from_micros(83);
    const PULSES: usize = 150;

    /// How late a thread ends pulses that waits as the one of the trigger does, sorted.
    fn late(prepare: impl FnOnce() + Send) -> Vec<Duration> {
        let pulse = || {
            let (mutex, never) = (Mutex::new(()), Condvar::new());
            let begun = Instant::now();
            let early = WIDTH - Duration::from_micros(200);
            drop(never.wait_timeout(mutex.lock().unwrap(), early));
            while begun.elapsed() < WIDTH {
                std::hint::spin_loop();
            }
            begun.elapsed() - WIDTH
        };
        let mut late: Vec<_> = std::thread::scope(|scope| {
            let pulses = scope.spawn(|| {
                prepare();
                (0..PULSES).map(|_| pulse()).collect()
            });
            pulses.join().unwrap()
        });
        late.sort_unstable();
        late
    }

    #[test]
    #[ignore = "a measurement that needs the right to a real-time priority, and loads every core"]
    fn a_prompt_thread_ends_pulses_in_time_beside_busy_ones() {
        let over = AtomicBool::new(false);
        let [ordinary, prompt] = std::thread::scope(|scope| {
            for _ in 0..2 * std::thread::available_parallelism().unwrap().get() {
                scope.spawn(|| {
                    while !over.load(Ordering::Relaxed) {
                        std::hint::spin_loop();
                    }
                });
            }
            let measured = [
                late(|| ()),
                late(|| assert!(be_prompt(None).real_time, "not permitted")),
            ];
            over.store(true, Ordering::Relaxed);
            measured
        });
        let spoiled = |late: &[Duration]| late.iter().filter(|late| **late > SPOILED).count();
        for (who, late) in [("ordinary", &ordinary), ("prompt", &prompt)] {
            let (median, worst) = (late[PULSES / 2], late[PULSES - 1]);
            println!(
                "{who}: {} of {PULSES} pulses spoiled, median {median:?}, worst {worst:?}",
                spoiled(late)
            );
        }
        assert!(spoiled(&prompt) * 10 < spoiled(&ordinary));
    }
}
