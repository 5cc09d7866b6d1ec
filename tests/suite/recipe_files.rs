//! The gauges of a recipe as a file that people edit: what is read is what was written, limits and
//! values follow golden and a master, and hostile files are refused by name.

use crate::station_plc::Place;
use crate::written::program;
use appliance::recipe::file::archive;
use appliance::recipe::file::gauges_toml::Gauging;
use appliance::recipe::{Recipe, RecipeFile};
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tests::files;
use tests::program::Run;
use tests::random::Random;

const SEED: u64 = 20_261_126;
/// Hostile texts for the library, and how many of them the program gets as well.
const TEXTS: usize = 250;
const BY_PROGRAM: usize = 16;
/// Longest time for one of them; the program also starts, unoptimised here.
const PATIENCE: Duration = Duration::from_secs(1);
const OF_PROGRAM: Duration = Duration::from_secs(5);
/// What the master of a gauge is above golden's own value, mm, and its standard uncertainty.
const ABOVE_MM: f64 = 0.050;
const MASTER_U: f64 = 0.004;
/// Values that differ by the master alone are the same up to rounding.
const EXACT: f64 = 1e-12;

/// A place with recipe 1, taught from its plane, and a copy of it as a file.
struct Bench {
    place: Place,
    recipe: PathBuf,
    text: PathBuf,
}

impl Bench {
    fn new() -> Self {
        let place = Place::taught();
        let (recipe, text) = (place.path("one.recipe"), place.path("gauges.toml"));
        fs::copy(place.recipe(), &recipe).unwrap();
        Self {
            place,
            recipe,
            text,
        }
    }

    fn run(&self, arguments: &[&str]) -> Run {
        let config = self.place.path("fringed.toml");
        // Gauges of a file need no head.
        let more = match arguments.starts_with(&["recipe", "gauges"]) {
            true => &[][..],
            false => &["--config", config.to_str().unwrap()],
        };
        program().run(&[arguments, more].concat())
    }

    fn get(&self) -> String {
        let recipe = self.recipe.to_str().unwrap();
        self.run(&["recipe", "gauges", recipe, "--get"])
            .succeeded()
            .stdout
    }

    fn set(&self, text: &str) -> Run {
        fs::write(&self.text, text).unwrap();
        let (recipe, text) = (self.recipe.to_str().unwrap(), self.text.to_str().unwrap());
        self.run(&["recipe", "gauges", recipe, "--set", text, "--json"])
    }

    /// Sets gauges; returns what golden has of the last one.
    fn golden(&self, text: &str) -> Value {
        let answer: Value = serde_json::from_str(&self.set(text).succeeded().stdout).unwrap();
        answer["gauges"].as_array().unwrap().last().unwrap().clone()
    }

    fn file(&self) -> RecipeFile {
        files::recipe(&fs::read(&self.recipe).unwrap()).0
    }
}

/// A gauge of the mean height, behind those of `before`.
fn with_height(before: &str, limits: &str) -> String {
    format!(
        "{before}\n[[gauge]]\nslot = 17\nname = \"height\"\nkind = \"mean_height\"\nof = [\"frame\"]\n{limits}\n"
    )
}

#[test]
fn the_text_of_a_recipe_is_the_same_after_it_was_set_and_the_fingerprint_changes_with_the_content()
{
    let bench = Bench::new();
    let (text, bytes) = (bench.get(), fs::read(&bench.recipe).unwrap());
    bench.set(&text).succeeded();
    assert_eq!(fs::read(&bench.recipe).unwrap(), bytes);
    let before = bench.file().fingerprint;
    let more = with_height(&text, "nominal = 0.125\nplus = 0.5\nminus = 0.25");
    let golden = bench.golden(&more);
    assert_eq!(
        (&golden["slot"], &golden["low"], &golden["high"]),
        (&17.into(), &(-0.125).into(), &0.625.into())
    );
    let (file, written) = (bench.file(), bench.get());
    assert_ne!(file.fingerprint, before);
    assert_eq!(file.gauges.last().unwrap().slot, 17);
    bench.set(&written).succeeded();
    assert_eq!((bench.get(), bench.file()), (written, file));
    // Another order of the gauges is none.
    let gauges: Vec<&str> = more.split("[[gauge]]").collect();
    let reversed: Vec<&str> = gauges[..1]
        .iter()
        .chain(gauges[1..].iter().rev())
        .copied()
        .collect();
    bench.set(&reversed.join("\n[[gauge]]")).succeeded();
    assert_eq!(bench.get(), Gauging::from_toml(&more).unwrap().to_toml());
}

#[test]
fn limits_by_golden_and_a_master_follow_the_part_that_is_taught_again() {
    let bench = Bench::new();
    let text = bench.get();
    let golden = bench.golden(&with_height(
        &text,
        "golden = true\nplus = 0.25\nminus = 0.125",
    ));
    let number = |of: &Value, key: &str| of[key].as_f64().unwrap();
    let own = number(&golden, "value");
    assert_eq!(number(&golden, "low"), own - 0.125);
    assert_eq!(number(&golden, "high"), own + 0.25);
    // A master moves the value, and is in U.
    let master = own + ABOVE_MM;
    let limits = format!(
        "golden = true\nplus = 0.25\nminus = 0.125\nmaster = {master:?}\nmaster_u = {MASTER_U}"
    );
    let moved = bench.golden(&with_height(&text, &limits));
    assert!(
        (number(&moved, "value") - own - ABOVE_MM).abs() < EXACT,
        "{moved}"
    );
    assert!(
        (number(&moved, "low") - (master - 0.125)).abs() < EXACT,
        "{moved}"
    );
    assert_eq!(number(&moved, "sigma"), number(&golden, "sigma"));
    let exact = bench.golden(&with_height(&text, &limits.replace("0.004", "0.0")));
    let of_master = number(&moved, "uncertainty").powi(2) - number(&exact, "uncertainty").powi(2);
    assert!(
        (of_master.sqrt() / (2.0 * MASTER_U) - 1.0).abs() < 1e-6,
        "{moved} {exact}"
    );
    // Taught again where the part is 0.3 mm higher.
    for (limits, follows) in [
        ("golden = true\nplus = 0.25\nminus = 0.125", true),
        ("nominal = 0.0\nplus = 0.9\nminus = 0.9", false),
    ] {
        bench.set(&with_height(&text, limits)).succeeded();
        let before = bench.file().gauges.last().unwrap().clone();
        let recipe = bench.recipe.to_str().unwrap();
        bench
            .run(&["recipe", "import", recipe, "--replace"])
            .succeeded();
        let again = [
            "teach",
            "--number",
            "1",
            "--replace",
            "--keep-gauges",
            "--shift",
            "0,0,0.3",
        ];
        bench.run(&again).succeeded();
        let (file, _) = files::recipe(&fs::read(bench.place.recipe()).unwrap());
        let after = file.gauges.last().unwrap();
        assert_eq!((after.slot, after.tolerance), (17, before.tolerance));
        let raised = after.low.unwrap() - before.low.unwrap();
        let expected = if follows { 0.3 } else { 0.0 };
        assert!((raised - expected).abs() < 0.02, "{raised}");
        if let Some(own) = after.golden_value {
            let limits = (Some(own - 0.125), Some(own + 0.25));
            assert_eq!((after.low, after.high), limits);
        }
    }
}

/// A text that no recipe of the bench can have: `base` with one thing wrong.
fn hostile(random: &mut Random, base: &str) -> String {
    let feature = |name: &str, corners: &str| {
        format!("\n[[feature]]\nname = \"{name}\"\nkind = \"surface\"\nregion = [{corners}]\n")
    };
    let square = "[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]";
    let gauge = |more: &str| format!("\n[[gauge]]\nname = \"bad\"\n{more}\n");
    let mean = |more: &str| {
        gauge(&format!(
            "slot = 30\nkind = \"mean_height\"\nof = [\"frame\"]\n{more}"
        ))
    };
    let huge = ["1e308", "-1e308", "1e17", "inf", "nan", "-nan"][random.below(6)];
    let number = 1_000 + random.below(100_000);
    let more = match random.below(26) {
        0 => gauge(&format!(
            "slot = 30\nkind = \"kind_{number}\"\nof = [\"frame\"]"
        )),
        1 => gauge(&format!(
            "slot = 30\nkind = \"mean_height\"\nof = [\"feature {number}\"]"
        )),
        2 => gauge("slot = 30\nkind = \"z\"\nof = [\"frame\"]"),
        3 => gauge("slot = 30\nkind = \"angle\"\nof = [\"frame\", \"frame\"]"),
        4 => gauge("slot = 30\nkind = \"step\"\nof = [\"frame\"]"),
        5 => gauge(&format!(
            "slot = {}\nkind = \"mean_height\"\nof = [\"frame\"]",
            [0, 1, 2, 65, number][random.below(5)]
        )),
        6 => mean(&format!("low = {huge}")),
        7 => mean(&format!("nominal = {huge}\nplus = 0.1")),
        8 => mean(&format!(
            "nominal = 0.0\nplus = -{number}\nminus = -{number}"
        )),
        9 => mean("low = 0.2\nhigh = 0.1"),
        10 => mean("low = 0.2\nnominal = 0.1\nplus = 0.1"),
        11 => mean("golden = true\nnominal = 0.1\nplus = 0.1"),
        12 => mean("plus = 0.1"),
        13 => mean("master_u = 0.1"),
        14 => mean(&format!("master = 0.1\nmaster_u = -{number}.0")),
        15 => mean(&format!("key_{number} = 1")),
        16 => mean("datum = \"A\""),
        17 => feature("line", "[1.0, 1.0], [2.0, 2.0]"),
        18 => feature(
            "outside",
            "[5000.0, 5000.0], [5010.0, 5000.0], [5010.0, 5010.0]",
        ),
        19 => feature("far", &format!("[{huge}, 0.0], [9.0, 1.0], [9.0, 9.0]")),
        20 => feature("frame", square),
        21 => format!("\n[[datum]]\nname = \"A\"\nof = [\"feature {number}\"]\n"),
        22 => feature("plane", square).replace("region", "plane = \"plane\"\nregion"),
        23 => (0..97 + random.below(2_000))
            .map(|at| feature(&format!("f{at}"), square))
            .collect(),
        24 => {
            let depth = 10 + random.below(100_000);
            format!("\nx = {}{}\n", "[".repeat(depth), "]".repeat(depth))
        }
        _ => feature(&"n".repeat(65 + random.below(1_000)), square),
    };
    // What stands in front of the tables belongs to none of them.
    match more.starts_with("\nx") {
        true => more + base,
        false => base.to_owned() + &more,
    }
}

#[test]
fn a_recipe_that_another_program_changes_is_left_alone_and_a_link_to_one_stays() {
    let mut bench = Bench::new();
    let text = bench
        .get()
        .replace("name = \"deviation\"", "name = \"other\"");
    let other = fs::File::open(&bench.recipe).unwrap();
    other.lock().unwrap();
    let before = fs::read(&bench.recipe).unwrap();
    let refused = bench.set(&text);
    assert_eq!(refused.code, 69, "{}", refused.stderr);
    assert!(
        refused
            .stderr
            .contains("another program is changing it: try again"),
        "{}",
        refused.stderr
    );
    assert_eq!(fs::read(&bench.recipe).unwrap(), before);
    drop(other);
    let file = bench.recipe.clone();
    bench.recipe = bench.place.path("link.recipe");
    std::os::unix::fs::symlink(&file, &bench.recipe).unwrap();
    bench.set(&text).succeeded();
    assert!(fs::symlink_metadata(&bench.recipe).unwrap().is_symlink());
    assert_ne!(fs::read(&file).unwrap(), before);
}

#[test]
fn hostile_texts_are_refused_by_name_at_once_and_nothing_is_written() {
    let bench = Bench::new();
    let (base, bytes) = (bench.get(), fs::read(&bench.recipe).unwrap());
    let (file, arrays) = files::recipe(&bytes);
    let mut random = Random::new(SEED);
    for case in 0..TEXTS {
        let text = hostile(&mut random, &base);
        let began = Instant::now();
        let set = Gauging::from_toml(&text).and_then(|read| read.set(&file, arrays.clone()));
        let shown: String = text.chars().rev().take(300).collect();
        let refusal = set.map(drop).expect_err(&shown);
        assert!(began.elapsed() < PATIENCE, "{case}: {refusal}");
        assert!(refusal.words.len() < 2_000, "{case}: {refusal}");
        if case < BY_PROGRAM {
            let began = Instant::now();
            let run = bench.set(&text);
            assert_eq!(run.code, 65, "{case}: {}", run.stderr);
            assert!(began.elapsed() < OF_PROGRAM, "{case}");
        }
    }
    let million = "[[feature]]\nname = \"a\"\n".repeat(1_000_000);
    assert_eq!(bench.set(&million).code, 65);
    for (arguments, code) in [
        (&["--get", "--set", "x.toml"][..], 64),
        (&[], 64),
        (&["--set", "/nowhere/gauges.toml"], 66),
    ] {
        let whole = [
            &["recipe", "gauges", bench.recipe.to_str().unwrap()],
            arguments,
        ]
        .concat();
        assert_eq!(bench.run(&whole).code, code, "{arguments:?}");
    }
    assert_eq!(
        bench
            .run(&["recipe", "gauges", "/nowhere/x.recipe", "--get"])
            .code,
        66
    );
    assert_eq!(fs::read(&bench.recipe).unwrap(), bytes);
}

#[test]
fn hostile_recipes_are_refused_and_the_stored_one_stays() {
    let bench = Bench::new();
    let (base, bytes) = (bench.get(), fs::read(&bench.recipe).unwrap());
    let (file, arrays) = files::recipe(&bytes);
    let stored = fs::read(bench.place.recipe()).unwrap();
    let mut random = Random::new(SEED + 1);
    let mut by_program = 0;
    for case in 0..TEXTS {
        let changed = match case % 2 {
            0 => Gauging::from_toml(&hostile(&mut random, &base))
                .ok()
                .map(|read| {
                    let file = RecipeFile {
                        features: read.features,
                        datums: read.datums,
                        gauges: read.gauges,
                        ..file.clone()
                    };
                    archive::pack(&file, &arrays).unwrap().0
                }),
            _ => {
                let mut damaged = bytes.clone();
                let at = random.below(damaged.len());
                match random.below(3) {
                    0 => damaged.truncate(at),
                    1 => damaged[at] ^= 1 << random.below(8),
                    _ => damaged.splice(at..at, [0xFF; 4]).for_each(drop),
                }
                Some(damaged)
            }
        };
        let Some(changed) = changed else { continue };
        let began = Instant::now();
        let read = Recipe::from_bytes(&changed);
        assert!(began.elapsed() < PATIENCE, "{case}");
        // Bytes that nobody reads, such as a member's time, may have changed.
        let Err(refusal) = read else {
            assert_eq!(case % 2, 1, "{case} was accepted");
            continue;
        };
        assert!(refusal.words.len() < 2_000, "{refusal}");
        if by_program < BY_PROGRAM {
            by_program += 1;
            let path = bench.place.path("hostile.recipe");
            fs::write(&path, &changed).unwrap();
            let began = Instant::now();
            let run = bench.run(&["recipe", "import", path.to_str().unwrap(), "--replace"]);
            assert_eq!(run.code, 65, "{case}: {}", run.stderr);
            assert!(began.elapsed() < OF_PROGRAM, "{case}");
        }
    }
    assert_eq!(by_program, BY_PROGRAM);
    assert_eq!(fs::read(bench.place.recipe()).unwrap(), stored);
}
