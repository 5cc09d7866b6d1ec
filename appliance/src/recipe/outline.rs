//! What a recipe measures, by names: what is said of a part beside its numbers.

use super::RecipeFile;
use algo::geometry::Vector;
use algo::inspect::{FoundFeature, Geometry, State};
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

/// A feature of a part that was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Seen<'a> {
    name: &'a str,
    kind: &'static str,
    state: &'static str,
    /// The share of its rim or surface that was seen.
    found: Option<f64>,
    /// σ of the camera's blur at its rim, px.
    blur_px: Option<f64>,
    /// Its centre or middle in the frame as taught, mm.
    centre: Option<[f64; 3]>,
    /// The direction of a line or of the axis of a slot, the normal of a plane or hole.
    direction: Option<[f64; 3]>,
    /// Diameter, or length and width, mm.
    size: Vec<f64>,
}

/// What became of a feature in a part, in a word.
fn word(state: State) -> &'static str {
    match state {
        State::Found => "found",
        State::Absent => "absent",
        State::Unseen => "unseen",
    }
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

    /// What became of each feature that a gauge needs: of those with a geometry as it was found, of
    /// others from what became of the gauge in a slot. Of several gauges, one that has a value
    /// decides.
    pub fn features(&self, found: &[FoundFeature], gauge: impl Fn(u16) -> State) -> Vec<Seen<'_>> {
        let by_gauges = |feature: &Outlined| {
            let states: Vec<State> = feature.slots.iter().map(|&slot| gauge(slot)).collect();
            let any = |state| states.contains(&state).then_some(state);
            any(State::Found)
                .or(any(State::Absent))
                .or(any(State::Unseen))
        };
        let list = |of: Vector| [of.x, of.y, of.z];
        let all = self.features.iter().enumerate();
        all.filter_map(|(at, feature)| {
            let found = found.iter().find(|found| found.feature == at);
            let geometry = found.and_then(|found| found.geometry);
            let direction = |of: Geometry| list(of.direction().unwrap_or(of.normal()));
            let state = found.map(|found| found.state);
            Some(Seen {
                name: &feature.name,
                kind: feature.kind,
                state: word(state.or_else(|| by_gauges(feature))?),
                found: found.map(|found| found.found),
                blur_px: found.and_then(|found| found.rim).map(|rim| rim.blur_px),
                centre: geometry.map(|of| list(of.point())),
                direction: geometry.map(direction),
                size: geometry.map_or(Vec::new(), |of| of.sizes().into_iter().flatten().collect()),
            })
        })
        .collect()
    }
}
