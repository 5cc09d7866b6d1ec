//! Patterns that ask for longer exposures get them, and no others do.

use super::*;
use crate::error::ErrorKind;

/// By how much all frames of a sequence were exposed too long, as a share of the exposure that the
/// camera is set to, and how long the camera took to start.
fn longer(head: &mut Head) -> (f32, Duration) {
    let (frames, result) = take(head, &[0, 1]);
    let exposure = result.unwrap();
    assert_eq!((frames.len(), exposure.retaken), (2, 0), "{exposure:?}");
    for (index, label) in &frames {
        let shown = Some(head.devices.kept + index);
        assert_eq!((label.shown, label.others), (shown, 0.0));
    }
    let [(_, first), (_, second)] = &frames[..] else {
        panic!("{frames:?}");
    };
    assert_eq!(first.longer, second.longer);
    (first.longer, exposure.start_up)
}

fn patterns() -> Vec<Raster> {
    vec![Raster::uniform(1, 1, 0).unwrap(); 2]
}

#[test]
fn a_pattern_is_exposed_twice_as_long_until_another_is_loaded_and_work_aside_is_not() {
    const START_UP: Duration = Duration::from_millis(500);
    let by_itself = Mechanics {
        free_running: free_running(REFRESH * 2, REFRESH / 3),
        ..plain()
    };
    let triggered = Mechanics {
        start_up: START_UP,
        ..plain()
    };
    for mechanics in [by_itself, triggered] {
        let stays = mechanics.free_running.is_none();
        let mut head = labelled(mechanics, 2);
        let set = head.camera_timing();
        assert_eq!(longer(&mut head).0, 0.0);
        head.expose(2).unwrap();
        assert_eq!(head.camera_timing().exposure, 2 * REFRESH);
        assert_eq!(head.camera_timing().period, set.period + REFRESH);
        assert_eq!(longer(&mut head).0, 1.0);
        // A camera that is on is started again only where its exposure has changed.
        assert_eq!(longer(&mut head), (1.0, Duration::ZERO));
        let go_on: GoOn = Arc::new(|| true);
        head.aside(2, go_on.clone(), |_| ());
        assert_eq!(longer(&mut head), (1.0, Duration::ZERO));
        head.aside(2, go_on, |head| {
            head.load(patterns()).unwrap();
            assert_eq!(head.camera_timing(), set);
            assert_eq!(longer(head).0, 0.0);
        });
        let start_up = if stays { START_UP } else { Duration::ZERO };
        assert_eq!(longer(&mut head), (1.0, start_up));
        assert_eq!(head.closed().exposures(), 2);
        head.load(patterns()).unwrap();
        assert_eq!((head.exposures(), head.camera_timing()), (1, set));
        assert_eq!(longer(&mut head).0, 0.0);
    }
}

#[test]
fn a_head_that_is_opened_again_exposes_as_it_is_set() {
    let (mut head, control) = virtual_head::head(Labels::default(), plain());
    head.load(patterns()).unwrap();
    let set = head.camera_timing();
    head.expose(3).unwrap();
    assert_eq!(control.exposure(), REFRESH);
    let mut again = control.reopen().unwrap();
    again.load(patterns()).unwrap();
    assert_eq!((again.exposures(), again.camera_timing()), (1, set));
    assert_eq!(longer(&mut again).0, 0.0);
}

#[test]
fn an_exposure_that_the_projector_sets_is_not_made_longer() {
    let mut head = labelled(
        Mechanics {
            by_projector: true,
            ..plain()
        },
        2,
    );
    head.expose(1).unwrap();
    let refused = head.expose(2).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::Unsupported, "{refused}");
    assert_eq!(head.exposures(), 1);
}
