//! What a recipe measures, by names: what is said of a part beside its numbers.

use super::RecipeFile;
use serde::Serialize;

/// The kinds of a recipe's gauges, and its features with the gauges that are of them.
#[derive(Clone, Debug)]
pub struct Outline {
    /// Slot and kind of each gauge.
    gauges: Vec<(u16, &'static str)>,
    features: Vec<Outlined>,
}

#[derive(Clone, Debug)]
struct Outlined {
    name: String,
    kind: &'static str,
    /// Slots of the gauges that are of it.
    slots: Vec<u16>,
}

/// What became of a feature in a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// It was measured.
    Found,
    /// It is surely not there.
    Absent,
    /// Nothing can be said of it.
    Unseen,
}

/// A feature of a part that was measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Seen<'a> {
    name: &'a str,
    kind: &'static str,
    state: State,
}

impl From<&RecipeFile> for Outline {
    fn from(file: &RecipeFile) -> Self {
        let gauges = file.gauges.iter();
        let of = |name: &String| {
            let gauges = file.gauges.iter().filter(|gauge| gauge.of.contains(name));
            gauges.map(|gauge| gauge.slot).collect()
        };
        let features = file.features.iter().map(|feature| Outlined {
            name: feature.name.clone(),
            kind: feature.kind.name(),
            slots: of(&feature.name),
        });
        Self {
            gauges: gauges
                .map(|gauge| (gauge.slot, gauge.measures.name()))
                .collect(),
            features: features.collect(),
        }
    }
}

impl Outline {
    /// The kind of the gauge in a slot.
    pub fn kind(&self, slot: u16) -> Option<&'static str> {
        let mut gauges = self.gauges.iter();
        let found = gauges.find(|(own, _)| *own == slot);
        found.map(|(_, kind)| *kind)
    }

    /// What became of each feature that a gauge is of, from what became of the gauge in a slot: of
    /// several gauges, one that has a value decides.
    pub fn features(&self, gauge: impl Fn(u16) -> State) -> Vec<Seen<'_>> {
        let seen = |feature: &Outlined| {
            let states: Vec<State> = feature.slots.iter().map(|&slot| gauge(slot)).collect();
            let any = |state| states.contains(&state).then_some(state);
            any(State::Found)
                .or(any(State::Absent))
                .or(any(State::Unseen))
        };
        let features = self.features.iter();
        features
            .filter_map(|feature| {
                Some(Seen {
                    name: &feature.name,
                    kind: feature.kind,
                    state: seen(feature)?,
                })
            })
            .collect()
    }
}
