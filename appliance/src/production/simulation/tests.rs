//! The part in front of a simulated head, without a station.

use super::*;

fn small() -> (Simulation, mpsc::Receiver<Order>, Stage) {
    let mut scenario = Scenario {
        sub_rays: 1,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (32, 32);
    let (_, stage) = sim::head(&scenario).unwrap();
    let (orders, inbox) = mpsc::channel();
    let simulation = Simulation::new(orders);
    simulation.opened(Some(&stage));
    (simulation, inbox, stage)
}

#[test]
fn a_part_is_named_by_its_kind_and_its_defects_by_their_numbers() {
    let mut placed = Placed::stock("sheet_metal").unwrap();
    placed.add_defect("dent:10,5,0.3,8").unwrap();
    placed.add_defect("missing_hole:2").unwrap();
    placed.add_defect("bent_flange:-3").unwrap();
    placed.check().unwrap();
    let defects = value(&placed.part)["defects"].clone();
    assert_eq!(
        defects,
        json!([
            { "kind": "dent", "x": 10.0, "y": 5.0, "depth_mm": 0.3, "diameter_mm": 8.0 },
            { "kind": "missing_hole", "index": 2 },
            { "kind": "bent_flange", "degrees": -3.0 },
        ])
    );
    assert_eq!(placed.good(), Placed::stock("sheet_metal").unwrap());
    for (defect, words) in [
        ("scratch:1,2", "dent:x,y,depth_mm,diameter_mm"),
        ("dent:1,2,3", "dent:x,y,depth_mm,diameter_mm"),
        ("dent:1,2,3,4,5", "dent:x,y"),
        ("dent:1,2,3,nan", "dent:x,y"),
        ("missing_hole:0.5", "index"),
        ("missing_hole:-1", "index"),
        ("missing_hole", "missing_hole:index"),
    ] {
        let error = placed.add_defect(defect).unwrap_err();
        assert!(
            error.contains(words) || error.contains("missing_hole"),
            "{defect}: {error}"
        );
    }
    let error = Placed::stock("plane")
        .unwrap()
        .add_defect("bent_flange:3")
        .unwrap_err();
    assert!(error.contains("plane has no bent_flange"), "{error}");
    assert!(Placed::stock("teapot").unwrap_err().contains("flowerpot"));
}

#[test]
fn every_number_is_bounded() {
    let with = |key: &str, number: f64| -> Placed {
        let mut placed = Placed::stock("sheet_metal").unwrap();
        let mut numbers = DEFECTS[0].1.to_vec();
        numbers
            .iter_mut()
            .filter(|(name, _)| *name == key)
            .for_each(|(_, n)| *n = number);
        placed.part = with_defect(&placed.part, defect("dent", numbers.into_iter())).unwrap();
        placed
    };
    with("x", 99.0).check().unwrap();
    for (key, number) in [
        ("x", 1e9),
        ("y", -1e9),
        ("depth_mm", 1e300),
        ("diameter_mm", 0.0),
    ] {
        assert!(with(key, number).check().is_err(), "{key}");
    }
    let mut far = Placed::stock("plane").unwrap();
    far.placement.shift_mm = [0.0, 0.0, 1e9];
    assert!(far.check().is_err());
    let mut many = Placed::stock("sheet_metal").unwrap();
    for _ in 0..=MAX_DEFECTS {
        many.add_defect("dent:0,0,0.1,5").unwrap();
    }
    assert!(many.check().unwrap_err().contains("17 defects"));
}

#[test]
fn the_page_is_offered_every_stock_part_with_the_defects_that_it_can_have() {
    let (simulation, _inbox, _) = small();
    let view = simulation.view();
    let kinds = view["kinds"].as_array().unwrap();
    assert_eq!(kinds.len(), 9);
    for one in kinds {
        let part: Part = serde_json::from_value(one["part"].clone()).unwrap();
        for defect in one["defects"].as_array().unwrap() {
            let defective = Placed {
                part: with_defect(&part, defect.clone()).unwrap(),
                ..Placed::default()
            };
            defective.check().unwrap();
        }
    }
    assert_eq!(kinds[0]["defects"].as_array().unwrap().len(), 3);
}

#[test]
fn a_part_is_in_place_only_once_the_measuring_task_has_put_it_there() {
    let (simulation, inbox, stage) = small();
    let other = Placed::stock("plane").unwrap();
    let putting = {
        let (simulation, other) = (simulation.clone(), other.clone());
        std::thread::spawn(move || simulation.put(&other))
    };
    let Order::Place(placing) = inbox.recv().unwrap() else {
        panic!("another order");
    };
    assert_eq!(stage.placed().0, Part::default());
    assert!(!putting.is_finished());
    placing.carry_out();
    assert_eq!(putting.join().unwrap(), Ok(()));
    assert_eq!(stage.placed(), (other.part, other.placement));
}

#[test]
fn a_part_that_the_measuring_task_does_not_take_is_taken_back() {
    let (simulation, inbox, stage) = small();
    let before = stage.placed();
    let other = Placed::stock("plane").unwrap();
    // As a lost head drops its orders.
    let dropping = std::thread::spawn(move || drop(inbox.recv().unwrap()));
    assert!(matches!(simulation.put(&other), Err(PutError::Busy(_))));
    dropping.join().unwrap();
    let (silent, late, _) = small();
    assert!(matches!(silent.put(&other), Err(PutError::Busy(_))));
    let Order::Place(placing) = late.recv().unwrap() else {
        panic!("another order");
    };
    placing.carry_out();
    assert_eq!(stage.placed(), before);
    assert_eq!(silent.stage.get().unwrap().placed(), before);
}

#[test]
fn only_a_simulated_head_is_shown_other_parts() {
    let simulation = Simulation::new(mpsc::channel().0);
    assert_eq!(simulation.view(), json!({ "simulated": false }));
    let error = simulation.put(&Placed::default()).unwrap_err();
    assert!(error.to_string().contains("not simulated"), "{error}");
}
