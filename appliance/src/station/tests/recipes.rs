//! Loading and teaching.

use super::*;

#[test]
fn boot_ends_when_the_head_is_open_and_ready_needs_a_recipe() {
    let mut bench = Bench::booting_with(settings());
    assert_eq!(bench.station.snapshot().state, 0);
    let snapshot = bench.event(Event::Started);
    assert_eq!((snapshot.state, snapshot.is(status::READY)), (1, false));
    assert_eq!(bench.token(5).reject_reason, reject::NO_RECIPE);
    let job = bench.teach(1);
    let snapshot = bench.event(Event::Progress {
        job,
        fraction: 0.5,
        words: "fitting".into(),
    });
    assert_eq!(
        snapshot.teach,
        Some(TeachProgress {
            number: 1,
            fraction: 0.5,
            words: "fitting".into()
        })
    );
    let snapshot = bench.event(Event::Taught {
        job,
        recipe: recipe(1),
    });
    assert!(snapshot.is(status::READY) && snapshot.is(status::RECIPE_OK));
}

#[test]
fn a_recipe_is_loaded_by_number_and_by_part_number() {
    let mut bench = Bench::ready();
    bench.select(12);
    let snapshot = bench.pulse(control::RECIPE_LOAD);
    assert_eq!((snapshot.state, snapshot.requested_recipe), (4, 12));
    assert!(snapshot.is(status::RECIPE_LOADING) && !snapshot.is(status::READY));
    assert_eq!(
        snapshot.recipe.map(|recipe| recipe.number),
        Some(1),
        "the old one until the new one is whole"
    );
    let job = bench.job();
    let snapshot = bench.event(Event::RecipeLoaded {
        job,
        recipe: recipe(12),
    });
    assert_eq!(
        (snapshot.state, snapshot.recipe.map(|recipe| recipe.number)),
        (1, Some(12))
    );
    let mut part_number = [None; 16];
    part_number[0] = Some(u16::from_be_bytes(*b"AB"));
    part_number[1] = Some(u16::from_be_bytes(*b"7\0"));
    bench.write(ControlWrite {
        part_number,
        recipe_select: Some(BY_PART_NUMBER),
        ..Default::default()
    });
    bench.pulse(control::RECIPE_LOAD);
    let job = bench.job();
    assert_eq!(
        bench.effects.last(),
        Some(&Effect::Load {
            job,
            key: RecipeKey::PartNumber("AB7".into())
        })
    );
}

#[test]
fn a_failed_load_keeps_the_old_recipe_and_says_why() {
    let mut bench = Bench::ready();
    for (result, number) in [
        (RecipeResult::Unknown, 1),
        (RecipeResult::Corrupt, 2),
        (RecipeResult::OtherCalibration, 3),
    ] {
        let snapshot = bench.load(12, Err(result));
        assert_eq!(
            (
                snapshot.recipe_result.number(),
                snapshot.recipe.clone().map(|recipe| recipe.number)
            ),
            (number, Some(1))
        );
        assert!(!snapshot.is(status::RECIPE_OK) && !snapshot.is(status::READY));
    }
}

#[test]
fn a_load_while_measuring_is_answered_with_busy() {
    let mut bench = Bench::ready();
    bench.token(1);
    bench.select(12);
    let snapshot = bench.pulse(control::RECIPE_LOAD);
    assert_eq!(
        (
            snapshot.state,
            snapshot.recipe_result,
            snapshot.reject_reason
        ),
        (2, RecipeResult::Busy, reject::NOT_READY)
    );
}

#[test]
fn a_load_with_recipe_select_0_leaves_the_recipe_as_it_is() {
    let mut bench = Bench::ready();
    let before = bench.station.snapshot();
    let after = bench.pulse(control::RECIPE_LOAD);
    assert_eq!(
        (after.state, after.recipe, after.recipe_result),
        (1, before.recipe, before.recipe_result)
    );
}

#[test]
fn a_load_beats_a_trigger_of_the_same_write() {
    let mut bench = Bench::ready();
    let bits = control::ONLINE | control::TRIGGER | control::RECIPE_LOAD;
    let write = ControlWrite {
        control: Masked::<u16>::all(bits),
        recipe_select: Some(12),
        token: Some(4),
        ..Default::default()
    };
    let snapshot = bench.write(write);
    assert_eq!(
        (snapshot.state, snapshot.missed, snapshot.reject_reason),
        (4, 1, reject::NOT_READY)
    );
    assert_eq!(bench.measured(), 0);
}

#[test]
fn the_plc_teaches_only_where_the_config_allows_it() {
    let mut bench = Bench::ready();
    assert_eq!(
        bench.pulse(control::TEACH).reject_reason,
        reject::TEACH_NOT_ALLOWED
    );
    let mut bench = Bench::ready_with(Settings {
        teach_allowed: true,
        ..settings()
    });
    bench.select(3);
    assert_eq!(bench.pulse(control::TEACH).state, 5);
    assert!(bench.effects.contains(&Effect::Teach {
        job: bench.job(),
        teaching: Teaching::of(3),
    }));
    let job = bench.job();
    let snapshot = bench.event(Event::TeachFailed {
        job,
        error_code: 201,
        message: "too dark".into(),
    });
    assert_eq!(
        (
            snapshot.state,
            snapshot.error_code,
            snapshot.recipe.map(|recipe| recipe.number)
        ),
        (1, 201, Some(1))
    );
}

#[test]
fn progress_extends_the_deadline_of_teaching() {
    let mut bench = Bench::ready();
    let job = bench.teach(2);
    for _ in 0..3 {
        assert_eq!(bench.tick_after(20_000).state, 5);
        bench.event(Event::Progress {
            job,
            fraction: 0.1,
            words: "x".into(),
        });
    }
    assert_eq!(bench.tick_after(31_000).state, 7);
}
