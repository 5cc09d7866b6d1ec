//! Copying frames takes no time of the thread that fetches them and fires triggers, and reads
//! cached memory where there is some.

use super::{next, samples, vimc, with_cameras};
use hal::camera::Camera;
use hal::clock::{Clock, Monotonic};
use hal::frame::Frame;
use rustix::time::{ClockId, clock_gettime};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::time::Duration;

/// Where a camera's buffers are looked for; Debian's kernel has that heap by another name.
const CACHED: &str = "/dev/dma_heap/vidbuf_cached";
const HEAP: &str = "/dev/dma_heap/system";
/// Most processor time of fetching a frame, of this thread alone. Copying its 19,200 samples takes
/// several times as long.
const FETCHED: Duration = Duration::from_micros(50);

/// Processor time of this thread.
fn spent() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::try_from(time).unwrap()
}

#[test]
fn fetching_a_frame_copies_nothing_and_its_buffer_is_cached_where_there_is_a_heap() {
    if !with_cameras() {
        return;
    }
    let heap = Path::new(HEAP).exists();
    let mut pictures = Vec::new();
    for linked in [false, true] {
        if linked && heap {
            symlink(HEAP, CACHED).unwrap();
        }
        let mut camera = vimc();
        assert_eq!(camera.cached(), linked && heap);
        let ready = camera.ready().unwrap();
        let mut clock = Monotonic::new(vec![ready]);
        camera.start().unwrap();
        let end = clock.now() + super::PATIENT;
        let mut longest = Duration::ZERO;
        let frame = loop {
            clock.wait(end);
            let begun = spent();
            let frame = camera.poll_frame().unwrap();
            longest = longest.max(spent() - begun);
            if let Some(frame) = frame {
                break frame;
            }
            assert!(clock.now() < end, "no frame");
        };
        println!("cached: {}, fetched in {longest:?}", camera.cached());
        assert!(longest < FETCHED, "{longest:?}");
        pictures.push((frame, next(&mut camera, &mut clock)));
    }
    let [driver, cached] = &pictures[..] else {
        panic!("two cameras");
    };
    let unlike = |a: &Frame, b: &Frame| {
        let pairs = samples(a).iter().zip(samples(b));
        pairs.filter(|(a, b)| a != b).count()
    };
    // A few pixels of the driver's picture change from frame to frame.
    let few = samples(&driver.0).len() / 100;
    assert!(unlike(&driver.0, &driver.1) < few);
    assert!(unlike(&driver.1, &cached.1) < few);
    if !heap {
        println!("this kernel has no {HEAP}: cached buffers were not tried");
    }
}
