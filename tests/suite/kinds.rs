//! The table of kinds as the program prints it, and as the documentation has it.

use crate::written::program;
use algo::inspect::Measure;
use serde_json::Value;
use std::fs;
use tests::shared::root;

#[test]
fn the_table_of_kinds_is_documented_kind_by_kind() {
    let printed = |more: &[&str]| {
        let run = program().run(&[&["recipe", "kinds"], more].concat());
        run.succeeded().stdout
    };
    let table: Value = serde_json::from_str(&printed(&["--json"])).unwrap();
    let text = printed(&[]);
    let documented = fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let kinds = table["kinds"].as_array().unwrap();
    assert_eq!(kinds.len(), Measure::examples().len());
    for kind in kinds {
        let name = kind["kind"].as_str().unwrap();
        assert!(text.contains(&format!("{name} (")), "{text}");
        let (_, row) = documented
            .split_once(&format!("\n| `{name}` | "))
            .unwrap_or_else(|| panic!("docs/formats.md has no row of {name}"));
        let row = row.lines().next().unwrap();
        for parameter in kind["parameters"].as_array().unwrap() {
            let name = parameter["name"].as_str().unwrap();
            assert!(text.contains(&format!("    {name} = ")), "{text}");
            // Sides of cells are explained once for all of them.
            assert!(
                row.contains(&format!("`{name}`")) || parameter["odd"] == false,
                "{row}"
            );
        }
    }
}
