//! What a change does to a recipe, in words, for the record of changes.

use super::file::RecipeFile;
use super::gauge::GaugeFile;
use hal::bounds::clipped;

impl RecipeFile {
    /// How the recipe differs from the one `before`: each limit with both of its values; "nothing"
    /// if it does not.
    pub fn differences(&self, before: &Self) -> String {
        let mut words = Vec::new();
        let mut text = |what: &str, from: &str, to: &str| {
            if from != to {
                let (from, to) = (clipped(from), clipped(to));
                words.push(format!("{what} from {from:?} to {to:?}"));
            }
        };
        text("name", &before.name, &self.name);
        text("part number", &before.part_number, &self.part_number);
        let mut number = |what: &str, from: f64, to: f64| {
            if from != to {
                words.push(format!("{what} from {from} to {to}"));
            }
        };
        number("guard band", before.guard_k, self.guard_k);
        number("least coverage", before.min_coverage, self.min_coverage);
        match (before.judges_nothing, self.judges_nothing) {
            (false, true) => words.push("judges nothing from now on".into()),
            (true, false) => words.push("judges again".into()),
            _ => {}
        }
        words.extend(gauges(&before.gauges, &self.gauges));
        words.extend(self.other_slots(before));
        words.extend(lists(
            ("feature", &before.features, &self.features),
            |feature| &feature.name,
            |before, after| match before.kind == after.kind {
                true => (before.region != after.region).then(|| "moved".into()),
                false => Some(format!("is a {} now", after.kind.name())),
            },
        ));
        words.extend(lists(
            ("datum", &before.datums, &self.datums),
            |datum| &datum.name,
            |before, after| (before.of != after.of).then(|| "is of other features".into()),
        ));
        match words.is_empty() {
            true => "nothing".into(),
            false => words.join("; "),
        }
    }

    /// Which gauges have another slot than `before`, in words; `None` if none has. A PLC reads
    /// gauges by their slots.
    pub fn other_slots(&self, before: &Self) -> Option<String> {
        let moved = self.gauges.iter().filter_map(|gauge| {
            let then = called(&before.gauges, &gauge.name)?.slot;
            let name = clipped(&gauge.name);
            (then != gauge.slot).then(|| format!("{name:?} from {then} to {}", gauge.slot))
        });
        let moved: Vec<_> = moved.collect();
        (!moved.is_empty()).then(|| format!("slots of gauges: {}", moved.join(", ")))
    }
}

/// What differs in two lists whose elements have names.
fn lists<'a, T>(
    (what, before, after): (&str, &'a [T], &'a [T]),
    name: impl Fn(&'a T) -> &'a String,
    difference: impl Fn(&'a T, &'a T) -> Option<String>,
) -> Vec<String> {
    let find = |list: &'a [T], wanted: &str| list.iter().find(|element| name(element) == wanted);
    let gone = before
        .iter()
        .filter(|element| find(after, name(element)).is_none())
        .map(|element| format!("{what} {:?} removed", clipped(name(element))));
    let others = after.iter().filter_map(|element| {
        let called = name(element);
        let found = match find(before, called) {
            None => Some("added".into()),
            Some(before) => difference(before, element),
        };
        found.map(|words| format!("{what} {:?} {words}", clipped(called)))
    });
    gone.chain(others).collect()
}

/// The gauge of this name.
fn called<'a>(gauges: &'a [GaugeFile], name: &str) -> Option<&'a GaugeFile> {
    gauges.iter().find(|gauge| gauge.name == name)
}

/// What differs in two lists of gauges. One whose name is gone and whose slot is not has another
/// name.
fn gauges(before: &[GaugeFile], after: &[GaugeFile]) -> Vec<String> {
    let renamed = |gauge: &&GaugeFile| called(before, &gauge.name).is_none();
    let kept = |gauge: &&GaugeFile| called(after, &gauge.name).is_some();
    let earlier = |gauge: &GaugeFile| {
        let mut gone = before.iter().filter(|gauge| !kept(gauge));
        gone.find(|gone| gone.slot == gauge.slot)
    };
    let new: Vec<_> = after.iter().filter(renamed).collect();
    let removed = before
        .iter()
        .filter(|gone| !kept(gone) && !new.iter().any(|gauge| gauge.slot == gone.slot));
    let removed = removed.map(|gone| format!("gauge {:?} removed", clipped(&gone.name)));
    let others = after.iter().filter_map(|after| {
        let same = called(before, &after.name);
        let words = match same.or_else(|| earlier(after)) {
            None => "added".to_owned(),
            Some(before) => gauge(before, after)?,
        };
        Some(format!("gauge {:?} {words}", clipped(&after.name)))
    });
    removed.chain(others).collect()
}

/// How a gauge differs, in words.
fn gauge(before: &GaugeFile, after: &GaugeFile) -> Option<String> {
    let mut words = Vec::new();
    if before.name != after.name {
        words.push(format!("instead of {:?}", clipped(&before.name)));
    }
    if before.measures != after.measures || before.of != after.of || before.datum != after.datum {
        words.push("measures something else".to_owned());
    }
    if before.master != after.master {
        words.push("has another master".to_owned());
    }
    let limit =
        |limit: Option<f64>, of: &GaugeFile| match (limit, of.measures.facts().unit.symbol()) {
            (None, _) => "none".to_owned(),
            (Some(limit), "") => limit.to_string(),
            (Some(limit), symbol) => format!("{limit} {symbol}"),
        };
    for (which, from, to) in [
        ("lowest", before.low, after.low),
        ("highest", before.high, after.high),
    ] {
        if from != to {
            let (from, to) = (limit(from, before), limit(to, after));
            words.push(format!("{which} from {from} to {to}"));
        }
    }
    (!words.is_empty()).then(|| words.join(", "))
}
