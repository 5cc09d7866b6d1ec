//! Another part in front of a simulated head, without a station.

use super::*;
use crate::head::placed::Placed;
use sim::{Part, Scenario};

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
fn a_part_is_in_place_only_once_the_measuring_task_has_put_it_there() {
    let (simulation, inbox, stage) = small();
    let other = Placed {
        material: Some(Material::Oiled),
        ..Placed::stock("plane").unwrap()
    };
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
    let there = (other.part, other.material, other.placement);
    assert_eq!(stage.placed(), there);
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
