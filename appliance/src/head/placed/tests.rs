//! Parts by their names and numbers.

use super::*;

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
        let error = placed.add_defect(defect).unwrap_err().to_string();
        assert!(
            error.contains(words) || error.contains("missing_hole"),
            "{defect}: {error}"
        );
    }
    let error = Placed::stock("plane")
        .unwrap()
        .add_defect("bent_flange:3")
        .unwrap_err()
        .to_string();
    assert!(error.contains("plane has no bent_flange"), "{error}");
    assert!(
        Placed::stock("teapot")
            .unwrap_err()
            .to_string()
            .contains("flowerpot")
    );
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
        add(&mut placed.part, defect("dent", numbers.into_iter())).unwrap();
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
    assert!(many.check().unwrap_err().to_string().contains("17 defects"));
}

#[test]
fn the_page_is_offered_every_stock_part_with_the_defects_that_it_can_have() {
    let kinds = kinds();
    assert_eq!(kinds.len(), 14);
    for one in &kinds {
        let mut defective: Placed = serde_json::from_value(json!({ "part": one["part"] })).unwrap();
        let defects = one["defects"].as_array().unwrap();
        for defect in defects {
            add(&mut defective.part, defect.clone()).unwrap();
        }
        defective.check().unwrap();
        let expected = match one["part"]["kind"].as_str().unwrap() {
            "sheet_metal" => 3,
            "plate" => 4,
            "board" | "empty" | "joint" => 0,
            _ => 1,
        };
        assert_eq!(defects.len(), expected, "{one}");
        assert!(expected < 1 || defects[0]["kind"] == "dent");
    }
}

/// Pixels of the small head whose height a defect changes by more than a tenth of a millimetre; all
/// of them must be seen by both devices, before and after.
fn changed(stage: &sim::Stage, good: &Part, bad: &Part) -> usize {
    let truth = |part| {
        stage.place(part, &Placement::default()).unwrap();
        stage.truth()
    };
    let (before, after) = (truth(good), truth(bad));
    let mut changed = 0;
    for at in 0..before.height.len() {
        assert_eq!(
            before.height[at].is_nan(),
            after.height[at].is_nan(),
            "pixel {at} of {bad:?}"
        );
        changed += usize::from((before.height[at] - after.height[at]).abs() > 0.1);
    }
    changed
}

#[test]
fn the_example_of_a_dent_lies_where_both_devices_see_it_on_every_part() {
    let mut scenario = Scenario {
        sub_rays: 1,
        ..Scenario::default()
    };
    (scenario.rig.camera.width, scenario.rig.camera.height) = (128, 128);
    let (_, stage) = sim::head(&scenario).unwrap();
    for one in kinds() {
        let good: Part = serde_json::from_value(one["part"].clone()).unwrap();
        for dent in one["defects"].as_array().unwrap() {
            if dent["kind"] != "dent" {
                continue;
            }
            let mut bad = good.clone();
            add(&mut bad, dent.clone()).unwrap();
            // A pixel sees 1.6 mm; a dent of 14 mm is deeper than 0.1 mm over a circle of 10 mm,
            // which a wall shows foreshortened.
            let found = changed(&stage, &good, &bad);
            assert!(found > 10, "{found} pixels of {bad:?}");
        }
    }
}

#[test]
fn a_part_keeps_its_material_when_its_defects_are_taken_away_and_has_none_by_itself() {
    let read = |value: Value| -> Result<Placed, String> {
        serde_json::from_value(value).map_err(|error| error.to_string())
    };
    let dent = json!({ "kind": "dent", "x": 0, "y": 10, "depth_mm": 0.3, "diameter_mm": 8 });
    let tube = json!({ "kind": "tube", "defects": [dent] });
    let oiled = read(json!({ "part": tube, "material": "oiled" })).unwrap();
    assert_eq!(oiled.material, Some(Material::Oiled));
    let expected = Placed {
        material: Some(Material::Oiled),
        ..Placed::stock("tube").unwrap()
    };
    assert_eq!(oiled.good(), expected);
    for none in [
        json!({ "part": "tube" }),
        json!({ "part": "tube", "material": null }),
    ] {
        assert_eq!(read(none).unwrap().material, None);
    }
    let error = read(json!({ "part": "tube", "material": "wood" })).unwrap_err();
    assert!(
        error.contains("wood") && error.contains("rolled_steel"),
        "{error}"
    );
    for (material, name) in Material::ALL {
        assert_eq!(serde_json::to_value(material).unwrap(), name);
    }
}

#[test]
fn a_floor_is_laid_taken_away_or_left_as_it_is() {
    let floor = |value: Value| serde_json::from_value::<Placed>(value).unwrap().floor;
    assert_eq!(floor(json!({ "part": "plate" })), None);
    assert_eq!(floor(json!({ "part": "plate", "floor": null })), Some(None));
    let laid = floor(json!({ "part": "plate", "floor": { "albedo": 0.1 } }));
    let grey = Ground {
        albedo: 0.1,
        ..Ground::default()
    };
    assert_eq!(laid, Some(Some(grey)));
    let wrong = json!({ "part": "plate", "floor": { "albedo": 2.0 } });
    let wrong: Placed = serde_json::from_value(wrong).unwrap();
    assert!(wrong.check().unwrap_err().to_string().contains("albedo"));
}

#[test]
fn a_board_is_placed_by_the_number_of_a_pose() {
    let read = |value: Value| -> Result<Placed, String> {
        serde_json::from_value(value).map_err(|error| error.to_string())
    };
    let third = read(json!({ "part": "board", "pose": 3 })).unwrap();
    assert_eq!(third.part, Part::Board(Board::default()));
    assert_eq!(third.placement, Board::POSES[2]);
    let bowed = json!({ "kind": "board", "bow_um": 30.0, "scale_ppm": 200.0 });
    let last = read(json!({ "part": bowed, "pose": 10 })).unwrap();
    assert_eq!(last.placement, Placement::default());
    last.check().unwrap();
    let placement = json!({ "tilt_deg": [5.0, 7.0] });
    let tilted = read(json!({ "part": bowed, "placement": placement })).unwrap();
    assert_eq!(tilted.placement.tilt_deg, [5.0, 7.0]);
    for (wrong, words) in [
        (json!({ "part": "board", "pose": 0 }), "write 1 to 10"),
        (json!({ "part": "board", "pose": 11 }), "write 1 to 10"),
        (json!({ "part": "plane", "pose": 1 }), "only a board"),
        (
            json!({ "part": "board", "pose": 1, "placement": {} }),
            "write one of them",
        ),
        (json!({ "part": "teapot" }), "flowerpot"),
        (json!({ "part": { "kind": "board", "bow": 1.0 } }), "bow"),
    ] {
        let error = read(wrong.clone()).unwrap_err();
        assert!(error.contains(words), "{wrong}: {error}");
    }
}
