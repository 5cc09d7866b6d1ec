//! Counts the instructions of a thread, where the system offers the processor's counters.

/// A counter of this thread, without the kernel's share.
#[cfg(target_os = "linux")]
pub struct Counter(std::fs::File);

/// `PERF_TYPE_HARDWARE`, `PERF_COUNT_HW_INSTRUCTIONS`.
#[cfg(target_os = "linux")]
const INSTRUCTIONS: (u32, u64) = (0, 1);

/// The descriptor is closed when the process executes another program.
#[cfg(target_os = "linux")]
const PERF_FLAG_FD_CLOEXEC: libc::c_ulong = 8;

/// The first version of the kernel's `struct perf_event_attr`, which every later kernel accepts.
#[cfg(target_os = "linux")]
#[repr(C)]
struct Attributes {
    kind: u32,
    size: u32,
    config: u64,
    /// Period, kind and form of samples: none are taken.
    sampling: [u64; 3],
    flags: u64,
    /// Wake-ups and breakpoints: none.
    rest: [u64; 2],
}

#[cfg(target_os = "linux")]
impl Counter {
    /// `exclude_kernel` and `exclude_hv`: what needs no privilege.
    const USER_ONLY: u64 = 1 << 5 | 1 << 6;

    /// A running counter of instructions; `None` where there is no such counter, as on most virtual
    /// machines, or where `/proc/sys/kernel/perf_event_paranoid` forbids it.
    pub fn instructions() -> Option<Self> {
        Self::of(INSTRUCTIONS)
    }

    /// A counter of an event, given by `type` and `config`.
    #[expect(unsafe_code, reason = "the call has no wrapper in the C library")]
    fn of((kind, config): (u32, u64)) -> Option<Self> {
        use std::os::fd::FromRawFd as _;
        let attributes = Attributes {
            kind,
            size: size_of::<Attributes>() as u32,
            config,
            sampling: [0; 3],
            flags: Self::USER_ONLY,
            rest: [0; 2],
        };
        let (this_thread, any_core, no_group) = (0, -1, -1);
        // SAFETY: the attributes outlive the call, and their size is in them.
        let descriptor = unsafe {
            libc::syscall(
                libc::SYS_perf_event_open,
                &raw const attributes,
                this_thread,
                any_core,
                no_group,
                PERF_FLAG_FD_CLOEXEC,
            )
        };
        let descriptor = i32::try_from(descriptor).ok().filter(|&fd| fd >= 0)?;
        // SAFETY: the kernel has just opened it, and nothing else owns it.
        Some(Self(unsafe { std::fs::File::from_raw_fd(descriptor) }))
    }

    /// The count so far.
    pub fn read(&self) -> Option<u64> {
        let mut count = [0; 8];
        std::io::Read::read_exact(&mut &self.0, &mut count).ok()?;
        Some(u64::from_ne_bytes(count))
    }
}

/// Other systems have no such counter.
#[cfg(not(target_os = "linux"))]
pub enum Counter {}

#[cfg(not(target_os = "linux"))]
impl Counter {
    /// None.
    pub fn instructions() -> Option<Self> {
        None
    }

    /// Never called.
    pub fn read(&self) -> Option<u64> {
        match *self {}
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// `PERF_TYPE_SOFTWARE`, `PERF_COUNT_SW_TASK_CLOCK`: also where the processor's counters are
    /// not offered.
    const TASK_CLOCK: (u32, u64) = (1, 1);

    #[test]
    fn a_counter_counts_what_its_thread_does() {
        // A sandbox may forbid every counter.
        let Some(clock) = Counter::of(TASK_CLOCK) else {
            return;
        };
        let before = clock.read().unwrap();
        std::hint::black_box((0..100_000_u64).map(std::hint::black_box).sum::<u64>());
        assert!(clock.read().unwrap() > before);
    }

    #[test]
    fn instructions_are_counted_or_there_is_no_counter() {
        let Some(counter) = Counter::instructions() else {
            return;
        };
        let before = counter.read().unwrap();
        std::hint::black_box((0..100_000_u64).map(std::hint::black_box).sum::<u64>());
        assert!(counter.read().unwrap() >= before + 100_000);
    }
}
