//! The part in front of a simulated head: its kind, its defects and its pose, checked.

use crate::error::{Exit, Failure, Result};
use hal::bounds::clipped;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value, json};
use sim::parts::{Across, Board, Defect, Joint, Plate};
use sim::{Ground, Material, Part, Placement, Scenario, Unsteady};

/// The most defects of a part: each ray is traced against all of them.
const MAX_DEFECTS: usize = 16;
/// Every kind of defect with the names of its numbers in their order, and an example of each.
const DEFECTS: [(&str, &[(&str, f64)]); 5] = [
    (
        "dent",
        &[
            ("x", 0.0),
            ("y", -8.0),
            ("depth_mm", 0.6),
            ("diameter_mm", 14.0),
        ],
    ),
    ("missing_hole", &[("index", 1.0)]),
    (
        "displaced_hole",
        &[("index", 1.0), ("dx", 1.0), ("dy", 0.0)],
    ),
    ("hole_radius", &[("index", 1.0), ("radius", 5.0)]),
    ("bent_flange", &[("degrees", 3.0)]),
];

/// A part and its placement, as a scenario has them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PlacedFile")]
pub struct Placed {
    /// The part with its defects.
    pub part: Part,
    /// What it is made of; none = the scenario's light says how it reflects.
    pub material: Option<Material>,
    /// Where it lies.
    pub placement: Placement,
    /// What it lies on and among, or that it lies on nothing; `None` leaves that as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor: Option<Option<Ground>>,
    /// How light and part change in time; `None` leaves that as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unsteady: Option<Unsteady>,
}

/// Every part that can be put in front of a head, good and as designed.
fn stock() -> impl Iterator<Item = Part> {
    let joint = |across| {
        Part::Joint(Joint {
            across,
            ..Joint::default()
        })
    };
    let solids = [
        Part::Plate(Plate {
            thickness_mm: 1.0,
            ..Plate::default()
        }),
        joint(Across::X),
    ];
    Part::stock().into_iter().chain(solids)
}

/// A part as clients write it: the part itself or the name of a stock part, with its placement or
/// the number of a board's pose.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlacedFile {
    part: Value,
    material: Option<Material>,
    placement: Option<Placement>,
    pose: Option<u8>,
    #[serde(default, deserialize_with = "given")]
    floor: Option<Option<Ground>>,
    unsteady: Option<Unsteady>,
}

/// A value whose key is given, also if it is `null`.
fn given<'a, T: Deserialize<'a>, D: Deserializer<'a>>(from: D) -> Result<Option<T>, D::Error> {
    T::deserialize(from).map(Some)
}

impl TryFrom<PlacedFile> for Placed {
    type Error = Failure;

    fn try_from(file: PlacedFile) -> Result<Self> {
        let mut placed = match file.part {
            Value::String(kind) => Self::stock(&kind)?,
            part => Self {
                part: serde_json::from_value(part).map_err(Exit::Content.because("part"))?,
                ..Self::default()
            },
        };
        (placed.material, placed.floor) = (file.material, file.floor);
        placed.unsteady = file.unsteady;
        match (file.placement, file.pose) {
            (Some(_), Some(_)) => {
                return Exit::Content.fail("placement and pose: write one of them");
            }
            (Some(placement), None) => placed.placement = placement,
            (None, Some(pose)) => placed.pose(pose)?,
            (None, None) => (),
        }
        Ok(placed)
    }
}

impl Placed {
    /// The stock part of a kind, without defects, in its designed pose.
    ///
    /// # Errors
    /// If there is no such kind, naming those that there are.
    pub fn stock(kind: &str) -> Result<Self> {
        let Some(part) = stock().find(|part| self::kind(part) == kind) else {
            let kinds: Vec<String> = stock().map(|part| self::kind(&part)).collect();
            let known = kinds.join(", ");
            return Exit::Content.fail(format!("there is no part {kind}: name one of {known}"));
        };
        Ok(Self {
            part,
            ..Self::default()
        })
    }

    /// Places a board in one of the poses that are recommended for a calibration, 1…10.
    ///
    /// # Errors
    /// If the part is no board, or there is no such pose.
    pub fn pose(&mut self, number: u8) -> Result<()> {
        if !matches!(self.part, Part::Board(_)) {
            return Exit::Content.fail(format!(
                "pose {number}: only a board has poses with numbers; write the placement of a {}",
                kind(&self.part)
            ));
        }
        let index = usize::from(number).checked_sub(1);
        let Some(pose) = index.and_then(|index| Board::POSES.get(index)) else {
            let most = Board::POSES.len();
            return Exit::Content.fail(format!("there is no pose {number}: write 1 to {most}"));
        };
        self.placement = *pose;
        Ok(())
    }

    /// The same part of the same material without its defects, in its designed pose.
    pub fn good(&self) -> Self {
        let mut part = self.part.clone();
        if let Some(defects) = part.defects_mut() {
            defects.clear();
        }
        Self {
            part,
            material: self.material,
            floor: self.floor.clone(),
            ..Self::default()
        }
    }

    /// Replaces the part that was `asked` for by a good one of its kind, which is taught first.
    /// Answers with the one that was asked for, which is placed afterwards.
    pub fn after_teaching(asked: &mut Option<Self>) -> Option<Self> {
        let placed = asked.take()?;
        *asked = Some(placed.good());
        Some(placed)
    }

    /// Adds a defect, `KIND:NUMBER,NUMBER,…`, as in `dent:10,5,0.3,8`.
    ///
    /// # Errors
    /// If the text is not a defect, or the part has none of this kind.
    pub fn add_defect(&mut self, text: &str) -> Result<()> {
        let form = |(kind, keys): &(&str, &[(&str, f64)])| {
            let names: Vec<&str> = keys.iter().map(|(name, _)| *name).collect();
            format!("{kind}:{}", names.join(","))
        };
        let (kind, numbers) = text.split_once(':').unwrap_or((text, ""));
        let known = DEFECTS.iter().find(|(name, _)| *name == kind);
        let Some(known) = known else {
            let forms: Vec<String> = DEFECTS.iter().map(form).collect();
            return Exit::Content.fail(format!(
                "there is no defect {:?}: write one of {}",
                clipped(kind),
                forms.join(" ")
            ));
        };
        let numbers: Vec<f64> = numbers
            .split(',')
            .map_while(|number| number.trim().parse().ok())
            .filter(|number: &f64| number.is_finite())
            .collect();
        let is_place = |n: f64| n >= 0.0 && n.fract() == 0.0;
        let mut named = known.1.iter().zip(&numbers);
        if numbers.len() != known.1.len()
            || numbers.len() != text.split(',').count()
            || !named.all(|((name, _), &n)| *name != "index" || is_place(n))
        {
            return Exit::Content.fail(format!(
                "{:?} is not a defect: write {}",
                clipped(text),
                form(known)
            ));
        }
        let named = known.1.iter().zip(numbers).map(|((name, _), n)| (*name, n));
        let what = format!("a {} has no {kind}", self::kind(&self.part));
        add(&mut self.part, defect(kind, named)).map_err(Exit::Content.because(what))
    }

    /// Checks every number.
    ///
    /// # Errors
    /// Naming the one that is out of its range.
    pub fn check(&self) -> Result<()> {
        let defects = self.part.defects().len();
        if defects > MAX_DEFECTS {
            return Exit::Content.fail(format!(
                "{defects} defects: at most {MAX_DEFECTS} are simulated on a part"
            ));
        }
        let scenario = Scenario {
            part: self.part.clone(),
            placement: self.placement,
            floor: self.floor.clone().flatten(),
            ..Scenario::default()
        };
        scenario.check().map_err(Exit::Content.failure())
    }
}

fn value(part: &Part) -> Value {
    serde_json::to_value(part).unwrap_or_default()
}

fn kind(part: &Part) -> String {
    value(part)["kind"].as_str().unwrap_or_default().to_owned()
}

fn defect<'a>(kind: &str, numbers: impl Iterator<Item = (&'a str, f64)>) -> Value {
    let mut defect = Map::from_iter([("kind".to_owned(), json!(kind))]);
    for (name, number) in numbers {
        let number = match name {
            // Checked to be a whole number.
            "index" => json!(number as u64),
            _ => json!(number),
        };
        defect.insert(name.to_owned(), number);
    }
    defect.into()
}

/// Adds a defect, if the part can have one of this kind.
fn add(part: &mut Part, defect: Value) -> Result<()> {
    let defect: Defect = serde_json::from_value(defect).map_err(Exit::Content.failure())?;
    part.can_have(&defect).map_err(Exit::Content.failure())?;
    if let Some(defects) = part.defects_mut() {
        defects.push(defect);
    }
    Ok(())
}

/// x and y of a place of a stock part that both devices see with some millimetres around it.
fn seen_place(part: &Part) -> [f64; 2] {
    match part {
        // Walls that face both devices.
        Part::Flowerpot(_) => [-60.0, 52.0],
        Part::Cone(_) => [-20.0, 35.0],
        // A flank.
        Part::Sawtooth(_) => [9.0, -8.0],
        // The forehead, and the grip between ridge and shoulder.
        Part::Face(_) => [0.0, 62.0],
        Part::Handset(_) => [17.0, 0.0],
        _ => [0.0, -8.0],
    }
}

/// Every stock part with an example of each defect that it can have, and the recommended poses of a
/// board.
pub fn kinds() -> Vec<Value> {
    let offers = |part: &Part| -> Vec<Value> {
        let [x, y] = seen_place(part);
        let placed = |(name, number): &(&'static str, f64)| match *name {
            "x" => (*name, x),
            "y" => (*name, y),
            name => (name, *number),
        };
        let all = DEFECTS
            .iter()
            .map(|(kind, numbers)| defect(kind, numbers.iter().map(placed)));
        all.filter(|defect| add(&mut part.clone(), defect.clone()).is_ok())
            .collect()
    };
    stock()
        .map(|part| match part {
            Part::Board(_) => json!({ "part": part, "defects": [], "poses": Board::POSES }),
            part => json!({ "part": part, "defects": offers(&part) }),
        })
        .collect()
}

#[cfg(test)]
mod tests;
