//! No part is measured with a recipe that was not asked for.

use super::*;

/// A trigger is rejected with reason 6 however it is given, counted as missed, and ends in no
/// result.
fn no_trigger_is_accepted(bench: &mut Bench) {
    let before = bench.station.snapshot();
    assert!(!before.is(status::READY), "{:?}", before.refusal_words());
    assert_eq!(before.refusal, Some(reject::OTHER_RECIPE));
    let measured = bench.measured();
    bench.token(before.last_token + 1);
    bench.pulse(control::TRIGGER);
    // The start line and the page: an edge without a write.
    let after = bench.event(Event::Write {
        write: ControlWrite::default(),
        rising: control::TRIGGER,
        client: Client::default(),
    });
    assert_eq!(
        (after.missed, after.reject_reason, after.triggers),
        (before.missed + 3, reject::OTHER_RECIPE, before.triggers)
    );
    assert!(after.is(status::MISSED_TRIGGER));
    assert_eq!(bench.measured(), measured);
    assert_eq!(
        (after.result_seq, after.result, after.last_token),
        (before.result_seq, before.result, before.last_token)
    );
}

fn a_trigger_is_accepted(bench: &mut Bench, recipe: u16) {
    let before = bench.station.snapshot();
    assert_eq!((before.is(status::READY), before.refusal), (true, None));
    bench.token(before.last_token + 1);
    let result = bench.finish().result.expect("a result");
    assert_eq!((result.recipe, result.verdict), (recipe, Verdict::Pass));
}

fn part_number(text: &str) -> [Option<u16>; 16] {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(32, 0);
    let mut words = [None; 16];
    for (word, pair) in words.iter_mut().zip(bytes.chunks_exact(2)) {
        *word = Some(u16::from_be_bytes([pair[0], pair[1]]));
    }
    words
}

#[test]
fn a_trigger_while_another_recipe_is_selected_is_rejected_and_gives_no_verdict() {
    let mut bench = Bench::ready();
    bench.select(77);
    no_trigger_is_accepted(&mut bench);
    for select in [1, 0] {
        bench.select(select);
        a_trigger_is_accepted(&mut bench, 1);
    }
}

#[test]
fn the_recipe_of_the_write_that_triggers_counts() {
    let mut bench = Bench::ready();
    let write = |token, recipe| ControlWrite {
        token: Some(token),
        recipe_select: Some(recipe),
        ..Default::default()
    };
    let rejected = bench.write(write(5, 77));
    assert_eq!(
        (rejected.missed, rejected.reject_reason, rejected.last_token),
        (1, reject::OTHER_RECIPE, 0)
    );
    let accepted = bench.write(write(5, 1));
    assert_eq!((accepted.triggers, accepted.last_token), (1, 5));
    bench.finish();
    let edge = ControlWrite {
        control: Masked::<u16>::all(control::ONLINE | control::TRIGGER),
        ..write(0, 77)
    };
    let rejected = bench.write(edge);
    assert_eq!(
        (rejected.missed, rejected.reject_reason, rejected.triggers),
        (2, reject::OTHER_RECIPE, 1)
    );
}

#[test]
fn a_trigger_while_another_part_number_is_selected_is_rejected() {
    let mut bench = Bench::ready();
    let select = |bench: &mut Bench, text: &str| {
        bench.write(ControlWrite {
            recipe_select: Some(BY_PART_NUMBER),
            part_number: part_number(text),
            ..Default::default()
        });
    };
    for other in ["PART-2", "PART-11", "part-1", "PART-", ""] {
        select(&mut bench, other);
        no_trigger_is_accepted(&mut bench);
    }
    select(&mut bench, " PART-1 ");
    a_trigger_is_accepted(&mut bench, 1);
    // PART_NUMBER alone, as in the write before a RECIPE_LOAD.
    bench.write(ControlWrite {
        part_number: part_number("PART-2"),
        ..Default::default()
    });
    no_trigger_is_accepted(&mut bench);
    bench.select(0);
    a_trigger_is_accepted(&mut bench, 1);
}

#[test]
fn a_recipe_without_a_part_number_is_not_selected_by_an_empty_one() {
    let mut bench = Bench::ready();
    bench.event(Event::Request(Request::Load(RecipeKey::Number(2))));
    let job = bench.job();
    let recipe = ActiveRecipe {
        part_number: "".into(),
        ..recipe(2)
    };
    bench.event(Event::RecipeLoaded { job, recipe });
    bench.select(BY_PART_NUMBER);
    no_trigger_is_accepted(&mut bench);
}

#[test]
fn after_a_failed_load_no_trigger_is_accepted_until_a_load_succeeds() {
    for failed in [
        RecipeResult::Unknown,
        RecipeResult::Corrupt,
        RecipeResult::OtherCalibration,
        // An abort of a load ends like this.
        RecipeResult::Busy,
    ] {
        let mut bench = Bench::ready();
        bench.load(77, Err(failed));
        no_trigger_is_accepted(&mut bench);
        // RECIPE_SELECT 0, selecting the active recipe and ERROR_RESET are no loads.
        for select in [0, 1] {
            bench.select(select);
            no_trigger_is_accepted(&mut bench);
            bench.pulse(control::ERROR_RESET);
            no_trigger_is_accepted(&mut bench);
        }
        bench.select(0);
        bench.pulse(control::RECIPE_LOAD);
        no_trigger_is_accepted(&mut bench);
        bench.load(1, Ok(()));
        a_trigger_is_accepted(&mut bench, 1);
        bench.load(2, Ok(()));
        a_trigger_is_accepted(&mut bench, 2);
    }
}

#[test]
fn a_load_of_the_plc_that_was_refused_while_measuring_is_one_that_failed() {
    let mut bench = Bench::ready();
    bench.token(1);
    bench.select(12);
    let refused = bench.pulse(control::RECIPE_LOAD);
    assert_eq!(
        (refused.requested_recipe, refused.recipe_result),
        (12, RecipeResult::Busy)
    );
    assert_eq!(
        bench.finish().result.map(|result| result.recipe),
        Some(1),
        "the part that was triggered before is measured as it was asked for"
    );
    no_trigger_is_accepted(&mut bench);
    bench.select(0);
    no_trigger_is_accepted(&mut bench);
    bench.load(12, Ok(()));
    a_trigger_is_accepted(&mut bench, 12);
}

#[test]
fn a_load_of_the_page_that_was_refused_changes_nothing() {
    let mut bench = Bench::ready();
    bench.token(1);
    let before = bench.station.snapshot();
    let after = bench.event(Event::Request(Request::Load(RecipeKey::Number(12))));
    assert_eq!(
        (after.requested_recipe, after.recipe_result),
        (before.requested_recipe, before.recipe_result)
    );
    bench.finish();
    a_trigger_is_accepted(&mut bench, 1);
}

#[test]
fn a_recipe_loaded_on_the_page_is_not_measured_for_a_plc_that_selects_another() {
    let mut bench = Bench::ready();
    bench.select(1);
    bench.event(Event::Request(Request::Load(RecipeKey::Number(2))));
    let job = bench.job();
    let snapshot = bench.event(Event::RecipeLoaded {
        job,
        recipe: recipe(2),
    });
    assert!(snapshot.is(status::RECIPE_OK), "it is what was requested");
    no_trigger_is_accepted(&mut bench);
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert!(
        words.contains("selects recipe 1") && words.contains("recipe 2 is active"),
        "{words}"
    );
    bench.load(1, Ok(()));
    a_trigger_is_accepted(&mut bench, 1);
}

#[test]
fn a_recipe_taught_beside_the_selected_one_is_not_measured_for_it() {
    let mut bench = Bench::ready();
    bench.select(1);
    let job = bench.teach(5);
    bench.event(Event::Taught {
        job,
        recipe: recipe(5),
    });
    no_trigger_is_accepted(&mut bench);
    bench.select(5);
    a_trigger_is_accepted(&mut bench, 5);
}

#[test]
fn after_a_teach_that_failed_the_active_recipe_goes_on() {
    let mut bench = Bench::ready();
    bench.select(1);
    let job = bench.teach(5);
    bench.event(Event::TeachFailed {
        job,
        error_code: 401,
        message: "too dark".into(),
    });
    a_trigger_is_accepted(&mut bench, 1);
}

#[test]
fn teaching_the_active_recipe_is_rejected_while_another_one_is_asked_for() {
    let allowed = || {
        Bench::ready_with(Settings {
            teach_allowed: true,
            ..settings()
        })
    };
    let mut bench = allowed();
    bench.write(ControlWrite {
        recipe_select: Some(BY_PART_NUMBER),
        part_number: part_number("PART-2"),
        ..Default::default()
    });
    let rejected = bench.pulse(control::TEACH);
    assert_eq!(
        (rejected.state, rejected.reject_reason, rejected.missed),
        (1, reject::OTHER_RECIPE, 0)
    );
    let mut bench = allowed();
    bench.load(77, Err(RecipeResult::Unknown));
    bench.select(0);
    assert_eq!(
        bench.pulse(control::TEACH).reject_reason,
        reject::OTHER_RECIPE
    );
    bench.select(77);
    assert_eq!(
        bench.pulse(control::TEACH).state,
        5,
        "the recipe that was asked for may be taught"
    );
}

#[test]
fn every_reason_has_words_that_say_what_to_do() {
    let mut bench = Bench::ready();
    bench.load(77, Err(RecipeResult::Unknown));
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert_eq!(
        words,
        "recipe 77 could not be loaded: there is no such recipe; load it, or recipe 1 to go on with that one"
    );
    let mut bench = Bench::ready();
    assert_eq!(bench.station.snapshot().refusal_words(), None);
    bench.select(77);
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert!(words.contains("RECIPE_SELECT"), "{words}");
    bench.control(0);
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert!(words.contains("ONLINE"), "{words}");
    let mut bench = Bench::booting_with(settings());
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert!(words.contains("boot"), "{words}");
    bench.event(Event::Started);
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert!(words.contains("fringed calibrate"), "{words}");
    bench.event(Event::Condition(Condition {
        calibration_valid: true,
        ..Condition::default()
    }));
    let words = bench.station.snapshot().refusal_words().expect("a reason");
    assert!(words.contains("load or teach"), "{words}");
}
