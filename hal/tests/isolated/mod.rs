//! A camera whose algorithms (IPA module) libcamera runs in a process of its own, as it does with
//! modules that it does not trust, and what becomes of it where that process gets no namespaces.
//!
//! In the service's unit `RestrictNamespaces=` refuses them; there is no such unit in this machine,
//! so the kernel's limit does.

use super::{Reading, settings, vimc, with_cameras};
use hal::camera::Camera;
use hal::libcamera::LibCamera;
use std::fs;
use std::process::{Command, Output};

/// What the library logs, which the error quotes.
const LOGGED: &str = "Failed to start proxy worker process";
/// The most user namespaces there may be.
const NAMESPACES: &str = "/proc/sys/user/max_user_namespaces";

/// Runs the test of this name, which is ignored otherwise, with every IPA module isolated.
fn isolated(name: &str) -> Output {
    Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "--nocapture", name])
        .env("LIBCAMERA_IPA_FORCE_ISOLATION", "1")
        .env("LIBCAMERA_PIPELINES_MATCH_LIST", "vimc")
        .output()
        .unwrap()
}

#[test]
fn a_camera_that_is_missing_because_its_algorithms_may_not_be_isolated_is_explained() {
    if !with_cameras() {
        return;
    }
    let passes = |name: &str| {
        let own = isolated(name);
        let said = String::from_utf8_lossy(&own.stdout).into_owned();
        assert!(own.status.success() && said.contains("1 passed"), "{own:?}");
        String::from_utf8_lossy(&own.stderr).into_owned()
    };
    passes("isolated::with_namespaces_it_works");
    let allowed = fs::read_to_string(NAMESPACES).unwrap();
    fs::write(NAMESPACES, "0").unwrap();
    let logged = passes("isolated::without_namespaces_the_cause_is_named");
    fs::write(NAMESPACES, allowed.trim()).unwrap();
    println!("{logged}");
    assert!(logged.contains(LOGGED), "{logged}");
}

#[test]
#[ignore = "run by the test above"]
fn with_namespaces_it_works() {
    let mut camera = vimc();
    camera.start().unwrap();
    camera.stop().unwrap();
}

#[test]
#[ignore = "run by the test above"]
fn without_namespaces_the_cause_is_named() {
    assert_eq!(LibCamera::list().unwrap(), []);
    let error = LibCamera::open(settings("vimc", Reading::Green)).unwrap_err();
    let said = error.to_string();
    for cause in [LOGGED, "IPA modules", "RestrictNamespaces="] {
        assert!(said.contains(cause), "{said}");
    }
}
