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
        words.extend(lists(
            ("gauge", &before.gauges, &self.gauges),
            |gauge| &gauge.name,
            gauge,
        ));
        words.extend(self.other_slots(before));
        words.extend(lists(
            ("region", &before.regions, &self.regions),
            |region| &region.name,
            |before, after| (before.polygon != after.polygon).then(|| "moved".into()),
        ));
        match words.is_empty() {
            true => "nothing".into(),
            false => words.join("; "),
        }
    }

    /// Which gauges have another slot than `before`, in words; `None` if none has. A PLC reads
    /// gauges by their slots.
    pub fn other_slots(&self, before: &Self) -> Option<String> {
        let slot = |gauges: &[GaugeFile], name: &str| {
            let mut names = gauges.iter().map(|gauge| &gauge.name);
            names.position(|other| other == name)
        };
        let moved = self.gauges.iter().enumerate().filter_map(|(now, gauge)| {
            let then = slot(&before.gauges, &gauge.name)?;
            let name = clipped(&gauge.name);
            (then != now).then(|| format!("{name:?} from {then} to {now}"))
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

/// How a gauge differs, in words.
fn gauge(before: &GaugeFile, after: &GaugeFile) -> Option<String> {
    let mut words = Vec::new();
    if before.measures != after.measures
        || (&before.region, &before.from) != (&after.region, &after.from)
    {
        words.push("measures something else".to_owned());
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
