//! Priorities of threads: those that must not slow the measuring task down, and the one that must
//! not be late.

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
