//! A production line that changes its part between triggers: the verdict always comes from the
//! selected recipe.

use crate::station_plc::{Daemon, Place, Plc, READY, RECIPE_OK, TRIGGER, long, trigger};
use crate::written::program;
use appliance::head::calibration::Calibration;
use appliance::recipe::Store;
use appliance::recipe::file::archive;
use appliance::recipe::plan::Plan;
use sim::Scenario;
use std::fs;
use std::time::{Duration, Instant};
use tests::files;
use tests::random::Random;

/// Good recipes.
const RECIPES: u16 = 20;
/// Recipes that must not become active, and their RECIPE_RESULT.
const UNKNOWN: (u16, u16) = (21, 1);
const CORRUPT: (u16, u16) = (22, 2);
const FOREIGN: (u16, u16) = (23, 3);
/// Bits of CONTROL.
const ONLINE: u16 = 1;
const RECIPE_LOAD: u16 = 1 << 3;
const RECIPE_LOADING: u16 = 1 << 8;
/// RECIPE_SELECT that selects by PART_NUMBER.
const BY_PART_NUMBER: u16 = 0xFFFF;
/// The REJECT_REASON for a recipe that is selected but not active.
const ANOTHER_RECIPE: u16 = 6;
/// Values of VERDICT.
const PASS: u16 = 1;
const FAIL: u16 = 2;
/// Longest time to switch recipes at 1456 × 1088 pixels.
const SWITCHING: Duration = Duration::from_secs(1);

/// The verdict of a recipe on the good part. It follows from the recipe's limits, which are far
/// from the noise of a measurement.
fn expected(number: u16) -> u16 {
    [PASS, FAIL][usize::from(number % 2)]
}

/// The taught recipe with another number, and with limits that lead to the verdict of that number.
fn changed(
    bytes: &[u8],
    number: u16,
    change: impl Fn(&mut appliance::recipe::RecipeFile),
) -> Vec<u8> {
    let (mut file, arrays) = files::recipe(bytes);
    file.number = number;
    file.part_number = part_number(number);
    if expected(number) == FAIL {
        // The deviation of a good part is far smaller.
        (file.gauges[0].low, file.gauges[0].high) = (Some(0.2), Some(0.3));
    }
    change(&mut file);
    archive::pack(&file, &arrays).unwrap().0
}

fn part_number(number: u16) -> String {
    format!("LINE-{number}")
}

/// A station with twenty recipes for its part, and three that it must refuse.
fn place() -> Place {
    let place = Place::taught();
    let taught = fs::read(place.recipe()).unwrap();
    let store = Store::open(&place.path("state/recipes")).unwrap();
    for number in 1..=RECIPES {
        store
            .save(number, &changed(&taught, number, |_| ()))
            .unwrap();
    }
    let mut damaged = changed(&taught, CORRUPT.0, |_| ());
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    store.save(CORRUPT.0, &damaged).unwrap();
    let foreign = changed(&taught, FOREIGN.0, |file| file.calibration = "0".repeat(64));
    store.save(FOREIGN.0, &foreign).unwrap();
    place
}

/// Selects a recipe by number or by part number, waits for the answer, and returns RECIPE_RESULT.
pub fn select(plc: &mut Plc, number: u16, by_part_number: bool) -> u16 {
    let mut fields = vec![ONLINE | RECIPE_LOAD, 0, number, 0, 0, 0, 0, 0];
    if by_part_number {
        fields[2] = BY_PART_NUMBER;
        let mut text = part_number(number).into_bytes();
        text.resize(32, 0);
        fields.extend(
            text.chunks(2)
                .map(|pair| u16::from_be_bytes([pair[0], pair[1]])),
        );
    }
    plc.write(0, &fields);
    plc.write(0, &[ONLINE]);
    let done = plc.wait("RECIPE_LOADING to fall", |status| {
        !status.has(RECIPE_LOADING)
    });
    done.recipe_result()
}

/// Changes the recipe at random between triggers, for `cycles` cycles.
fn change_over(cycles: u16) {
    let place = place();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    plc.write(0, &[ONLINE]);
    // First each recipe once, in order.
    let mut token = 0;
    let mut crcs = Vec::new();
    for number in 1..=RECIPES {
        assert_eq!(select(&mut plc, number, false), 0);
        token += 1;
        let words = plc.measure(token);
        assert_eq!((words[3], words[8]), (number, expected(number)));
        crcs.push(long(&words, 4));
    }
    let mut random = Random::new(0x11E_C4A6);
    let mut active = RECIPES;
    let (mut times, mut back) = (Vec::new(), Vec::new());
    for _ in 0..cycles {
        let wanted = 1 + random.below(usize::from(RECIPES) + 3) as u16;
        let began = Instant::now();
        let answer = select(&mut plc, wanted, random.below(2) == 0 && wanted <= RECIPES);
        times.push(began.elapsed());
        let refused = [UNKNOWN, CORRUPT, FOREIGN]
            .iter()
            .find(|(number, _)| *number == wanted);
        assert_eq!(
            answer,
            refused.map_or(0, |(_, answer)| *answer),
            "recipe {wanted}"
        );
        if refused.is_some() {
            token += 1;
            nothing_is_measured(&mut plc, token);
            let began = Instant::now();
            assert_eq!(select(&mut plc, active, random.below(2) == 0), 0);
            back.push(began.elapsed());
        } else {
            active = wanted;
        }
        for _ in 0..=random.below(2) {
            token += 1;
            let words = plc.measure(token);
            assert_eq!(words[3], active);
            assert_eq!(
                long(&words, 4),
                crcs[usize::from(active) - 1],
                "recipe {active}"
            );
            assert_eq!(words[8], expected(active), "recipe {active}");
        }
    }
    times.sort();
    println!(
        "{cycles} changes between {RECIPES} recipes: every verdict as unhurried; {:?} median, {:?} longest; back to the active \
         one after a refusal: {back:?}",
        times[times.len() / 2],
        times[times.len() - 1]
    );
}

/// Checks after a failed load that nothing is measured: triggers by token with the selected recipe,
/// with none, with the active one, and by edge.
fn nothing_is_measured(plc: &mut Plc, token: u16) {
    let before = plc.status();
    assert!(!before.has(READY) && !before.has(RECIPE_OK));
    for select in [None, Some(0), Some(before.active_recipe())] {
        let mut words = vec![token];
        words.extend(select);
        let status = plc.write_and_read_status(1, &words);
        assert!(!status.has(READY));
    }
    let status = plc.write_and_read_status(0, &[ONLINE | TRIGGER]);
    assert_eq!(
        (status.missed(), status.0[20]),
        (before.missed() + 4, ANOTHER_RECIPE)
    );
    assert_eq!(
        (status.triggers(), status.seq(), status.last_token()),
        (before.triggers(), before.seq(), before.last_token())
    );
    plc.write(0, &[ONLINE]);
}

#[test]
fn a_client_that_selects_recipe_77_while_1_is_active_gets_reason_6_and_no_verdict() {
    let place = Place::taught();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    plc.write(0, &[ONLINE]);
    let mut fields = trigger(7);
    fields[1] = 77;
    let by_token = plc.write_and_read_status(1, &fields);
    assert_eq!((by_token.missed(), by_token.0[20]), (1, ANOTHER_RECIPE));
    let by_edge = plc.write_and_read_status(0, &[ONLINE | TRIGGER, 0, 77]);
    assert_eq!((by_edge.missed(), by_edge.0[20]), (2, ANOTHER_RECIPE));
    plc.write(0, &[ONLINE]);
    assert_eq!(select(&mut plc, 77, false), UNKNOWN.1);
    nothing_is_measured(&mut plc, 7);
    let after = plc.status();
    assert_eq!((after.triggers(), after.seq()), (0, before.seq()));
    assert_eq!(plc.read(208, 1).unwrap(), [0], "no verdict");
    assert_eq!(select(&mut plc, 1, false), 0);
    let words = plc.measure(7);
    assert_eq!((words[3], words[8]), (1, PASS));
}

#[test]
fn verdicts_on_a_line_that_changes_over_are_those_of_an_unhurried_run() {
    change_over(15);
}

#[test]
#[ignore = "minutes: `.ci/run full` does it"]
fn verdicts_of_five_hundred_changes_are_those_of_an_unhurried_run() {
    change_over(500);
}

/// A head with the camera size of the reference hardware.
const FULL_HEAD: &str = "sub_rays = 1\n[rig.camera]\nwidth = 1456\nheight = 1088\n";
/// Number of recipes of that size. More than stay loaded, so each has to be read.
const MANY: u16 = 5;

#[test]
#[ignore = "minutes: `.ci/run full` does it"]
fn recipes_at_full_resolution_are_switched_within_a_second() {
    let place = Place::before(FULL_HEAD);
    let config = place.path("fringed.toml");
    program()
        .run(&[
            "teach",
            "--number",
            "1",
            "--config",
            config.to_str().unwrap(),
        ])
        .succeeded();
    let bytes = fs::read(place.recipe()).unwrap();
    let store = Store::open(&place.path("state/recipes")).unwrap();
    for number in 2..=MANY {
        store
            .save(number, &changed(&bytes, number, |_| ()))
            .unwrap();
    }
    stages(&store, bytes.len());
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    plc.write(0, &[ONLINE]);
    let (mut token, mut number) = (0, 1);
    let mut switch = |number| {
        let began = Instant::now();
        assert_eq!(select(&mut plc, number, false), 0);
        let time = began.elapsed();
        token += 1;
        plc.write(1, &trigger(token));
        assert_eq!(plc.measure(token)[3], number);
        time
    };
    let mut cold = Vec::new();
    for _ in 0..2 * MANY {
        number = number % MANY + 1;
        cold.push(switch(number));
    }
    let warm: Vec<_> = (0..6).map(|at| switch([MANY, number][at % 2])).collect();
    let again: Vec<_> = (0..3).map(|_| switch(number)).collect();
    println!(
        "switching at 1456 x 1088, trigger in between: {cold:?} where the recipe is read, {warm:?} where it is ready, \
         {again:?} where it is active"
    );
    // Other programs use this machine too, so only the shortest time shows the duration of the
    // work.
    let shortest = |times: &[Duration]| times.iter().min().copied().unwrap();
    assert!(shortest(&warm) < SWITCHING, "{warm:?}");
    assert!(shortest(&again) < shortest(&warm) / 2, "{again:?}");
}

/// Prints the durations of the parts of a switch, three times. Checks that the processor time of
/// all threads is less than a second, so an idle machine switches within a second.
fn stages(store: &Store, bytes: usize) {
    let scenario = Scenario::from_toml(FULL_HEAD, "full").unwrap();
    let (mut head, stage) = sim::head(&scenario).unwrap();
    let calibration = Calibration::of_scenario(stage.scenario()).unwrap();
    let mut works = Vec::new();
    for number in 1..=3 {
        let (began, worked) = (Instant::now(), processor_time());
        let mut last = began;
        let mut lap = || {
            let took = last.elapsed();
            last = Instant::now();
            took
        };
        let loaded = store.load(number).unwrap();
        let read = lap();
        let plan = Plan::new(loaded.recipe, &calibration, true).unwrap();
        let planned = lap();
        let rasters = plan.rasters(&calibration).unwrap();
        let encoded = lap();
        head.load(rasters).unwrap();
        let shown = lap();
        println!(
            "a recipe of {bytes} bytes, a plan of {}: read and checked in {read:?}, planned in {planned:?}, rasters \
             encoded in {encoded:?}, loaded in {shown:?}: {:?}, {:?} of processors",
            plan.bytes(),
            began.elapsed(),
            processor_time() - worked
        );
        works.push(processor_time() - worked);
    }
    assert!(works.iter().min().unwrap() < &SWITCHING, "{works:?}");
}

/// The processor time of all threads of this process, in units of 10 ms.
fn processor_time() -> Duration {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    // After the name, which may contain blanks: the state, ten numbers, then user and system time
    // in hundredths of a second.
    let (_, fields) = stat.rsplit_once(')').unwrap();
    let fields = fields.split_whitespace().skip(11).take(2);
    let ticks: u64 = fields.map(|ticks| ticks.parse::<u64>().unwrap()).sum();
    Duration::from_millis(10 * ticks)
}
