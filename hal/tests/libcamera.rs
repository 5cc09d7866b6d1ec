//! The camera back-end with virtual cameras of libcamera and of the kernel; runs in the machine of
//! `tests/vm` only.
//!
//! "Replay" delivers four fringe images that are drawn here, each four times, as fast as frames are
//! requested. "vimc" uses a real driver and takes seconds for a frame. Neither has a raw format or
//! a settable exposure; these are tested without a camera.

#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::panic)]

mod copied;
mod isolated;
mod machine;

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::fs;
use std::time::{Duration, Instant};

use hal::camera::{Camera, Starts};
use hal::clock::{Clock, Monotonic, monotonic};
use hal::contract::check_camera;
use hal::error::ErrorKind;
use hal::frame::{Frame, FrameFormat, Samples};
use hal::libcamera::{LibCamera, Reading, Settings};
use hal::setup::CameraSetup;
use machine::in_the_machine;

const SIZE: (u32, u32) = (640, 400);
/// Images that the virtual camera replays, and how often each is repeated.
const IMAGES: usize = 4;
const REPEATS: usize = 4;
const AMPLITUDE: f64 = 100.0;
/// Largest mean difference of an image from the one drawn, counts. JPEG and its decoder cause 1.7
/// (measured). The limit is half of what a shift by one column causes, 2 sin(π / 40) · 2/π
/// amplitudes; another image differs by 90 counts.
const LIKENESS: f64 = 5.0;
/// Longer than any wait here lasts normally: vimc needs 6 s for its first frame.
const PATIENT: Duration = Duration::from_secs(30);
/// Longest time in which vimc stops: its driver stops at the end of a frame.
const A_FRAME: Duration = Duration::from_secs(8);

const CAMERAS: &str = "/usr/share/libcamera/pipeline/virtual/virtual.yaml";
const IMAGE_FOLDER: &str = "/replay/";

/// Whether this runs in the machine, whose cameras are then set up.
fn with_cameras() -> bool {
    let there = in_the_machine();
    if there && !fs::exists(CAMERAS).unwrap() {
        set_up();
    }
    there
}

/// Describes the virtual cameras and draws what they replay.
fn set_up() {
    // The root folder of an emulated program (tests/aarch64/rpi.sh); empty in the virtual machine.
    let root = std::env::var("VM_ROOT").unwrap_or_default();
    fs::create_dir_all(format!("{root}{IMAGE_FOLDER}")).unwrap();
    for image in 0..IMAGES {
        let path = format!("{root}{IMAGE_FOLDER}{image}.jpg");
        let jpeg = jpeg_encoder::Encoder::new_file(path, 100).unwrap();
        let (width, height) = (SIZE.0 as u16, SIZE.1 as u16);
        jpeg.encode(
            &fringes(image),
            width,
            height,
            jpeg_encoder::ColorType::Luma,
        )
        .unwrap();
    }
    fs::write(format!("{root}{CAMERAS}"), include_str!("virtual.yaml")).unwrap();
}

/// Fringes with a pitch of 40 pixels; image n is shifted by n quarters of a turn.
fn fringes(image: usize) -> Vec<u8> {
    let turns = |x: u32| f64::from(x) / 40.0 + image as f64 / IMAGES as f64;
    let row = (0..SIZE.0).map(|x| (128.0 + AMPLITUDE * (TAU * turns(x)).cos()).round() as u8);
    let row: Vec<u8> = row.collect();
    row.repeat(SIZE.1 as usize)
}

fn settings(id: &str, reading: Reading) -> Settings {
    Settings {
        id: Some(id.to_owned()),
        reading,
        controlled: false,
        ..Settings::new(&CameraSetup::default(), Starts::ByItself)
    }
}

fn open(id: &str, reading: Reading) -> LibCamera {
    LibCamera::open(settings(id, reading)).unwrap()
}

fn vimc() -> LibCamera {
    let all = LibCamera::list().unwrap();
    let id = all
        .iter()
        .find(|camera| camera.id.contains("vimc"))
        .unwrap();
    LibCamera::open(Settings {
        size: Some((160, 120)),
        ..settings(&id.id, Reading::Green)
    })
    .unwrap()
}

fn samples(frame: &Frame) -> &[u8] {
    match frame.samples() {
        Samples::Eight(samples) => samples,
        Samples::Sixteen(_) => panic!("a frame of 8 bits is one of bytes"),
    }
}

/// The next frame, awaited on the head's clock.
fn next(camera: &mut LibCamera, clock: &mut Monotonic) -> Frame {
    let end = clock.now() + PATIENT;
    while clock.now() < end {
        if let Some(frame) = camera.poll_frame().unwrap() {
            return frame;
        }
        clock.wait(end);
    }
    panic!("no frame within {PATIENT:?}");
}

fn clock_of(camera: &LibCamera) -> Monotonic {
    Monotonic::new(vec![camera.ready().unwrap()])
}

/// The image that a frame shows, and the mean difference from it in counts.
fn shown(frame: &Frame) -> (usize, f64) {
    let off = |image: usize| {
        let drawn = fringes(image);
        let sum: u64 = samples(frame)
            .iter()
            .zip(&drawn)
            .map(|(a, b)| u64::from(a.abs_diff(*b)))
            .sum();
        sum as f64 / drawn.len() as f64
    };
    let all = (0..IMAGES).map(|image| (image, off(image)));
    all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
}

fn descriptors() -> usize {
    fs::read_dir("/proc/self/fd").unwrap().count()
}

#[test]
fn cameras_are_listed_and_opened_by_their_ids_in_any_order() {
    if !with_cameras() {
        return;
    }
    let all = LibCamera::list().unwrap();
    println!("{all:?}");
    let models = |id: &str| {
        let camera = all.iter().find(|camera| camera.id == id).unwrap();
        camera.model.clone().unwrap()
    };
    assert_eq!(
        (models("Bars"), models("Replay")),
        ("bars".into(), "replay".into())
    );
    assert!(all.iter().any(|camera| camera.id.contains("vimc")));
    for (id, size) in [("Replay", SIZE), ("Bars", (1280, 800)), ("Replay", SIZE)] {
        let format = open(id, Reading::Luma).format();
        assert_eq!((format.width, format.height), size);
    }
    let error = LibCamera::open(settings("0", Reading::Luma)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Disconnected);
    assert!(error.to_string().contains("`Replay`"), "{error}");
    let any = Settings {
        id: None,
        ..settings("", Reading::Luma)
    };
    let error = LibCamera::open(any).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.to_string().contains("`Bars`"), "{error}");
}

#[test]
fn without_any_camera_opening_says_so() {
    if !with_cameras() {
        return;
    }
    // The library remembers the cameras of its first start, so this needs a process of its own.
    let own = std::process::Command::new(std::env::current_exe().unwrap())
        .args([
            "--ignored",
            "--exact",
            "--nocapture",
            "where_the_library_knows_no_camera",
        ])
        .env("LIBCAMERA_PIPELINES_MATCH_LIST", "uvcvideo")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&own.stdout);
    assert!(own.status.success() && said.contains("1 passed"), "{own:?}");
}

#[test]
#[ignore = "run by the test above"]
fn where_the_library_knows_no_camera() {
    assert_eq!(LibCamera::list().unwrap(), []);
    let error = LibCamera::open(settings("Replay", Reading::Luma)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Disconnected);
    assert!(error.to_string().contains("no camera at all"), "{error}");
}

#[test]
fn what_a_camera_adjusts_is_taken_only_if_it_is_what_was_wanted() {
    if !with_cameras() {
        return;
    }
    let refused = |settings: Settings| {
        let error = LibCamera::open(settings).unwrap_err();
        println!("{error}");
        assert_eq!(error.kind(), ErrorKind::Unsupported);
        error.to_string()
    };
    let luma = || settings("Replay", Reading::Luma);
    assert!(refused(settings("Replay", Reading::Raw)).contains("NV12 (only where luma"));
    assert!(refused(settings("Replay", Reading::Green)).contains("NV12"));
    let size = Some((641, 400));
    assert!(refused(Settings { size, ..luma() }).contains("NV12 of 640×400"));
    let controlled = Settings {
        controlled: true,
        ..luma()
    };
    assert!(refused(controlled).contains("setting the exposure, gain"));

    let camera = LibCamera::open(Settings {
        size: Some(SIZE),
        ..luma()
    });
    let camera = camera.unwrap();
    assert_eq!(camera.format(), FrameFormat::packed(SIZE.0, SIZE.1, 8));
    let encoding = camera.encoding();
    assert_eq!((encoding.name.as_str(), encoding.exact), ("NV12", false));
    assert_eq!(camera.buffers(), 4, "8 were asked for, and 4 granted");
}

#[test]
fn replayed_fringes_come_in_order_without_a_gap_in_memory_that_is_used_again() {
    if !with_cameras() {
        return;
    }
    let mut camera = open("Replay", Reading::Luma);
    let mut clock = clock_of(&camera);
    let begun = clock.now();
    camera.start().unwrap();
    let (mut places, mut last, mut worst) = (BTreeSet::new(), None::<Frame>, 0.0_f64);
    let mut images = Vec::new();
    for _ in 0..3 * IMAGES * REPEATS {
        let frame = next(&mut camera, &mut clock);
        let (image, off) = shown(&frame);
        worst = worst.max(off);
        images.push(image);
        places.insert(samples(&frame).as_ptr());
        if let Some(last) = &last {
            assert_eq!(frame.count(), last.count() + 1);
            assert!(frame.timestamp() >= last.timestamp());
        }
        assert!(frame.timestamp() >= begun && frame.timestamp() <= clock.now());
        last = Some(frame);
    }
    let took = clock.now().since(begun);
    println!(
        "{} frames in {took:?}, off by {worst:.2} counts, in {} places",
        images.len(),
        places.len()
    );
    assert!(worst < LIKENESS, "{worst}");
    let steps: Vec<usize> = images.chunks(REPEATS).map(|four| four[0]).collect();
    assert!(
        images
            .chunks(REPEATS)
            .all(|four| four.iter().all(|i| *i == four[0])),
        "{images:?}"
    );
    assert!(
        steps.windows(2).all(|two| two[1] == (two[0] + 1) % IMAGES),
        "{steps:?}"
    );
    assert!(places.len() <= camera.buffers() + 2, "{places:?}");
}

#[test]
fn kept_frames_stay_what_they_are_and_outlive_their_camera() {
    if !with_cameras() {
        return;
    }
    let mut camera = open("Replay", Reading::Luma);
    let mut clock = clock_of(&camera);
    camera.start().unwrap();
    // Three times as many as it has buffers.
    let kept: Vec<Frame> = (0..12).map(|_| next(&mut camera, &mut clock)).collect();
    let first: Vec<_> = kept.iter().map(shown).collect();
    for _ in 0..12 {
        next(&mut camera, &mut clock);
    }
    let places: BTreeSet<_> = kept.iter().map(|frame| samples(frame).as_ptr()).collect();
    assert_eq!(places.len(), kept.len());
    camera.stop().unwrap();
    // A buffer that is kept over a stop is not written after the next start.
    camera.start().unwrap();
    next(&mut camera, &mut clock);
    drop(camera);
    println!("kept: {first:?}");
    assert_eq!(kept.iter().map(shown).collect::<Vec<_>>(), first);
    assert!(first.iter().all(|(_, off)| *off < LIKENESS));
}

#[test]
fn stopping_takes_back_the_requests_in_flight_and_starting_again_works() {
    if !with_cameras() {
        return;
    }
    let mut camera = open("Replay", Reading::Luma);
    let mut clock = clock_of(&camera);
    let mut last = 0;
    for _ in 0..5 {
        camera.start().unwrap();
        camera.stop().unwrap();
        assert_eq!(camera.poll_frame().unwrap_err().kind(), ErrorKind::Protocol);
        camera.start().unwrap();
        let frame = next(&mut camera, &mut clock);
        assert!(frame.count() >= last, "the count goes on over a stop");
        last = frame.count() + 1;
        camera.stop().unwrap();
    }
    drop((camera, clock));
    // This camera is stopped during its first frame, with all its requests in flight.
    let mut camera = vimc();
    let mut clock = clock_of(&camera);
    camera.start().unwrap();
    assert!(camera.poll_frame().unwrap().is_none());
    let begun = Instant::now();
    camera.stop().unwrap();
    println!("vimc stopped amid a frame in {:?}", begun.elapsed());
    assert!(begun.elapsed() < A_FRAME);
    camera.start().unwrap();
    next(&mut camera, &mut clock);
    drop(camera);
}

#[test]
fn twenty_starts_and_stops_and_five_openings_leak_no_descriptor() {
    if !with_cameras() {
        return;
    }
    // After this, everything exists that the library keeps for the life of the process.
    let mut camera = open("Replay", Reading::Luma);
    camera.start().unwrap();
    drop(camera);
    let closed = descriptors();
    for _ in 0..5 {
        let mut camera = open("Replay", Reading::Luma);
        let mut clock = clock_of(&camera);
        camera.start().unwrap();
        camera.stop().unwrap();
        let opened = descriptors();
        for _ in 0..20 {
            camera.start().unwrap();
            let kept = [next(&mut camera, &mut clock), next(&mut camera, &mut clock)];
            camera.stop().unwrap();
            drop(kept);
            assert_eq!(descriptors(), opened);
        }
        println!("{closed} descriptors closed, {opened} opened");
        drop((camera, clock));
        assert_eq!(descriptors(), closed);
    }
}

#[test]
fn one_camera_is_open_at_a_time() {
    if !with_cameras() {
        return;
    }
    let camera = open("Replay", Reading::Luma);
    let error = LibCamera::open(settings("Bars", Reading::Luma)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Protocol);
    assert_eq!(LibCamera::list().unwrap_err().kind(), ErrorKind::Protocol);
    drop(camera);
    open("Bars", Reading::Luma);
}

#[test]
fn a_wait_ends_with_a_frame_or_in_time_and_polling_never_waits() {
    if !with_cameras() {
        return;
    }
    let mut camera = open("Replay", Reading::Luma);
    let mut clock = clock_of(&camera);
    camera.start().unwrap();
    let begun = clock.now();
    next(&mut camera, &mut clock);
    let woken = clock.now().since(begun);
    assert!(woken < Duration::from_secs(1), "{woken:?}");
    camera.stop().unwrap();
    drop((camera, clock));

    let mut camera = open("Replay", Reading::Luma);
    let mut clock = clock_of(&camera);
    // Stopped with frames that were not fetched: they are discarded and end no wait.
    camera.start().unwrap();
    clock.wait(clock.now() + PATIENT);
    camera.stop().unwrap();
    let (begun, wait) = (clock.now(), Duration::from_millis(100));
    clock.wait(begun + wait);
    let waited = clock.now().since(begun);
    println!("woken by a frame after {woken:?}, by none after {waited:?} of {wait:?}");
    assert!(waited >= wait && waited < wait * 2, "{waited:?}");
}

#[test]
fn a_real_driver_gives_frames_with_times_and_counts_that_increase() {
    if !with_cameras() {
        return;
    }
    let mut camera = vimc();
    let mut clock = clock_of(&camera);
    let begun = clock.now();
    camera.start().unwrap();
    let two = [next(&mut camera, &mut clock), next(&mut camera, &mut clock)];
    let ended = monotonic();
    for frame in &two {
        println!(
            "frame {} after {:?}",
            frame.count(),
            frame.timestamp().since(begun)
        );
        assert_eq!(frame.format(), FrameFormat::packed(160, 120, 8));
        assert!(frame.timestamp() >= begun && frame.timestamp() <= ended);
        // Its picture is of coloured bars.
        let different: BTreeSet<u8> = samples(frame).iter().copied().collect();
        assert!(different.len() > 1);
    }
    assert!(two[1].timestamp() > two[0].timestamp());
    assert!(two[1].count() > two[0].count());
}

#[test]
fn the_contract_of_a_camera_is_kept() {
    if !with_cameras() {
        return;
    }
    let mut camera = open("Replay", Reading::Luma);
    let mut clock = clock_of(&camera);
    check_camera(&mut camera, &mut clock).unwrap();
}
