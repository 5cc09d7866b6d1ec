//! The features of a recipe in its file, and datum systems of them.
//!
//! A kind of feature is an arm of `KindRow::of`, and of contours their own file in `algo`; a key of
//! features is a row of `keys!`: reading, writing,
//! bounds, forms and the checked feature follow from these. The file form has the keys of all
//! kinds, so that a key of another kind is refused by its name.

use super::refusal::refused;
use crate::recipe::Refusal;
use algo::inspect::kinds::{Found, Gap, MeanHeight, Z};
use algo::inspect::{Cut, Feature, FeatureKind, Measure, Region};
use hal::bounded;
use hal::bounds::{Bound, Fields, Longest, MAX_SIDE, OutOfBounds, length, text, within};
use serde_json::{Value, json};

/// The longest name of a recipe, feature, datum system or gauge, in characters.
pub const LONGEST_NAME: usize = 64;
/// Features of a datum system.
pub(crate) const MAX_OF: usize = 3;
/// Largest radius of a rim and largest thickness of a sheet, mm.
const MAX_RIM_MM: f64 = 10.0;
const MAX_THICKNESS_MM: f64 = 20.0;
/// Longest and widest section, mm.
const MAX_SECTION_MM: f64 = 1000.0;
/// Corners of a region.
pub(crate) const MAX_CORNERS: usize = 256;
/// How far the region of a contour reaches beyond it on both sides, mm: room for where the part may
/// lie, and for the face that its plane is fitted to.
const AROUND_MM: f64 = 1.5;
/// The radius of a rim that is not stated, mm: U then covers rims rounded by up to 0.3 mm, as those
/// of punched sheets are, with diameters larger by 0.42 of that (docs/accuracy.md).
const UNKNOWN_RIM_MM: f64 = 0.35;

/// What a key of a feature holds.
enum Holds {
    /// The name of a plane.
    Plane,
    /// The radius of a rim, mm.
    Rim,
    /// 0 or more mm, up to this many.
    Length(f64),
    /// More than 0 mm, up to this many.
    Positive(f64),
    /// From where to where, 0 or more mm, up to this many.
    Stretch(f64),
    /// A pixel of golden's frame.
    Pixel,
}

/// A key of a feature beside its name, kind and region.
struct FeatureKey {
    name: &'static str,
    about: &'static str,
    holds: Holds,
    /// Another key that must be there with it.
    with: Option<&'static str>,
}

/// Defines the file form of a feature. A row is a key, its type, what it holds, and what a form
/// says of it.
macro_rules! keys {
    ($($key:ident: $type:ty = $holds:expr $(, with $with:ident)?; $about:literal)*) => {
        bounded! {
            /// Geometry of the part, by what is measured of a region.
            pub struct FeatureFile {
                /// Its name.
                pub name: String = Longest(LONGEST_NAME),
                /// What is made of the measured points.
                pub kind: FeatureKind,
                /// Corners [u, v] of a polygon in camera pixels of the golden measurement; a section
                /// has none.
                #[serde(default, skip_serializing_if = "Vec::is_empty")]
                pub region: Vec<[f64; 2]>,
                $(#[doc = $about]
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $key: Option<$type> = $holds,)*
            }
        }

        const KEYS: &[FeatureKey] = &[$(FeatureKey {
            name: stringify!($key),
            about: $about,
            holds: $holds,
            with: [$(stringify!($with))?].as_slice().first().copied(),
        },)*];

        impl FeatureFile {
            /// A feature in a polygon.
            pub fn new(name: impl Into<String>, kind: FeatureKind, region: Vec<[f64; 2]>) -> Self {
                Self { name: name.into(), kind, region, $($key: None,)* }
            }

            /// The names of the keys that are there.
            fn present(&self) -> Vec<&'static str> {
                let keys = [$((stringify!($key), self.$key.is_some()),)*];
                let present = keys.into_iter().filter(|(_, is_there)| *is_there);
                present.map(|(name, _)| name).collect()
            }
        }
    };
}

keys! {
    plane: String = Holds::Plane;
        "the plane that it lies in; nothing: one is fitted to the face around it"
    rim_mm: f64 = Holds::Rim;
        "radius of the rims of openings: U of what is measured at them covers it; where nobody states it, rims of up to 0.3 mm"
    thickness_mm: f64 = Holds::Length(MAX_THICKNESS_MM);
        "thickness of its sheet, for the walls of holes in it; 0 where no wall is seen, nothing where it is not known"
    from: [f64; 2] = Holds::Pixel;
        "where it begins"
    to: [f64; 2] = Holds::Pixel;
        "where it ends, behind the joint"
    width_mm: f64 = Holds::Positive(MAX_SECTION_MM);
        "its width across that way"
    left: [f64; 2] = Holds::Stretch(MAX_SECTION_MM);
        "from where to where the side before the joint is flat, from the beginning"
    right: [f64; 2] = Holds::Stretch(MAX_SECTION_MM);
        "the same of the side behind the joint"
    edge_mm: f64 = Holds::Positive(MAX_RIM_MM);
        "radius of both edges, where it is known; nothing: it is measured"
    edge_tolerance_mm: f64 = Holds::Length(MAX_RIM_MM), with edge_mm;
        "how far that radius may be off, ±: U of a gap is as large as this; nothing: 5 % of the radius (1 σ)"
}

/// A kind of feature.
pub(crate) struct KindRow {
    pub kind: FeatureKind,
    about: &'static str,
    /// How a form draws it; one that is drawn as a section has no region.
    shapes: &'static [&'static str],
    /// The kind of gauge that measures its size, where that is one number.
    size: Option<&'static str>,
    /// A gauge that every such feature has.
    pub probe: fn() -> Measure,
    /// The keys that it must have, and those that it may have.
    needs: &'static [&'static str],
    may: &'static [&'static str],
}

const SECTION: &[&str] = &["section"];

bounded! {
    /// A datum system (ISO 5459).
    pub struct DatumFile {
        /// Its name.
        pub name: String = Longest(LONGEST_NAME),
        /// The names of its features, the primary datum first.
        pub of: Vec<String>,
    }
}

impl Bound<String> for Holds {
    fn check(&self, key: &str, name: &String) -> Result<(), OutOfBounds> {
        text(key, name, LONGEST_NAME)
    }
}

impl Bound<f64> for Holds {
    fn check(&self, key: &str, value: &f64) -> Result<(), OutOfBounds> {
        within(key, *value, 0.0, self.most())
    }
}

impl Bound<[f64; 2]> for Holds {
    fn check(&self, key: &str, values: &[f64; 2]) -> Result<(), OutOfBounds> {
        (0.0..=self.most()).check(key, values)
    }
}

impl Holds {
    /// The largest number.
    fn most(&self) -> f64 {
        match *self {
            Self::Rim => MAX_RIM_MM,
            Self::Length(most) | Self::Positive(most) | Self::Stretch(most) => most,
            Self::Plane | Self::Pixel => MAX_SIDE.into(),
        }
    }
}

/// Names as in "a, b or c".
fn listed(names: &[&str], last: &str) -> String {
    match names {
        [first @ .., end] if !first.is_empty() => format!("{} {last} {end}", first.join(", ")),
        names => names.concat(),
    }
}

impl KindRow {
    /// That of a kind; a contour's follows from what its own file says of it.
    pub(crate) fn of(kind: FeatureKind) -> Self {
        let area = |about| Self {
            kind,
            about,
            shapes: &["rectangle", "polygon", "circle"],
            size: None,
            probe: || MeanHeight {}.into(),
            needs: &[],
            may: &[],
        };
        match (kind, kind.contour()) {
            (_, Some(contour)) => Self {
                shapes: match (kind.is_opening(), contour.sizes) {
                    (false, _) => &["points", "rectangle", "polygon"],
                    (true, 1) => &["circle", "rectangle", "polygon"],
                    (true, _) => &["rectangle", "polygon"],
                },
                size: (contour.sizes == 1).then_some("diameter"),
                probe: || Found {}.into(),
                may: &["plane", "rim_mm"],
                ..area(contour.about)
            },
            (FeatureKind::Plane, _) => Self {
                probe: || Z {}.into(),
                may: &["thickness_mm", "rim_mm"],
                ..area("The plane that fits the heights of a region best, by least squares.")
            },
            (FeatureKind::Section, _) => Self {
                shapes: SECTION,
                needs: &["from", "to", "width_mm", "left", "right"],
                probe: || Gap {}.into(),
                may: &["edge_mm", "edge_tolerance_mm"],
                ..area("A cut across a joint of two sheets with rounded edges.")
            },
            _ => area("Heights, and deviations from golden, of a region."),
        }
    }

    fn has(&self, key: &str) -> bool {
        self.needs.contains(&key) || self.may.contains(&key)
    }

    /// What a form needs (docs/api.md, `GET /api/kinds`).
    pub(crate) fn json(&self) -> Value {
        let Self { kind, about, .. } = self;
        let keys = self.needs.iter().chain(self.may);
        let keys = keys.filter_map(|name| KEYS.iter().find(|key| key.name == *name));
        // The gauges that take such a feature in one of their places.
        let fits = |of: &&Measure| of.facts().takes.iter().any(|place| place.contains(kind));
        let gauges = Measure::examples();
        let gauges = gauges.iter().filter(fits).map(Measure::name);
        json!({
            "kind": kind.name(), "about": about, "shapes": self.shapes, "size": self.size,
            "around_mm": kind.is_contour().then_some(AROUND_MM),
            "parameters": keys.map(|key| self.parameter(key)).collect::<Vec<_>>(),
            "gauges": gauges.collect::<Vec<_>>(),
        })
    }

    /// What a form needs of a key.
    fn parameter(&self, key: &FeatureKey) -> Value {
        let most = key.holds.most();
        let mut all = match key.holds {
            Holds::Plane => json!({ "features": [FeatureKind::Plane.name()] }),
            Holds::Rim => {
                let unstated = match self.has("plane") {
                    true => "as its plane's",
                    false => "not known",
                };
                let stated =
                    json!({ "nothing": unstated, "zero": "sharp", "number": "rolled up to" });
                json!({ "unit": "mm", "least": 0.0, "most": most, "stated": stated })
            }
            Holds::Length(_) => json!({ "unit": "mm", "least": 0.0, "most": most }),
            Holds::Positive(_) => json!({ "unit": "mm", "above": 0.0, "most": most }),
            Holds::Stretch(_) => json!({ "unit": "mm", "least": 0.0, "most": most, "count": 2 }),
            Holds::Pixel => json!({ "unit": "px", "least": 0.0, "count": 2 }),
        };
        all["name"] = key.name.into();
        all["about"] = key.about.into();
        all["optional"] = self.may.contains(&key.name).into();
        all
    }
}

impl FeatureFile {
    /// A feature of the cells of a polygon.
    pub fn surface(name: impl Into<String>, region: Vec<[f64; 2]>) -> Self {
        Self::new(name, FeatureKind::Surface, region)
    }

    /// Checks each value by itself.
    ///
    /// # Errors
    /// In words that name the key, the value and the bounds.
    pub(crate) fn check_bounds(&self) -> Result<(), Refusal> {
        Fields.check("", self)?;
        self.check_keys()?;
        if let Some(cut) = self.cut() {
            return check_section(&cut);
        }
        length("region", self.region.len(), 3, MAX_CORNERS)?;
        // Polygons are clipped to the frame: corners up to one frame's width outside of it are
        // enough for any shape.
        let far = f64::from(MAX_SIDE);
        let mut corners = self.region.as_flattened().iter();
        Ok(corners.try_for_each(|corner| within("region", *corner, -far, 2.0 * far))?)
    }

    /// Refuses keys that its kind does not have, and lacks of those that it must have.
    fn check_keys(&self) -> Result<(), Refusal> {
        let name = self.kind.name();
        let kind = KindRow::of(self.kind);
        let present = self.present();
        let refused =
            |key: &str, whose: String| refused!("{key} of a {name}: {whose} has it, leave it out");
        if !self.region.is_empty() && kind.shapes == SECTION {
            return refused("region", "any other kind".into());
        }
        for key in KEYS.iter().filter(|key| present.contains(&key.name)) {
            let complete = key.with.is_none_or(|with| present.contains(&with));
            if !(complete && kind.has(key.name)) {
                let owners = FeatureKind::ALL.map(KindRow::of).into_iter();
                let owners = owners.filter(|row| row.has(key.name));
                let owners: Vec<_> = owners.map(|row| row.kind.name()).collect();
                let with = key.with.map(|with| format!(" with an {with}"));
                let owners = listed(&owners, "or");
                return refused(key.name, format!("a {owners}{}", with.unwrap_or_default()));
            }
        }
        let needs = kind.needs;
        match needs.iter().all(|key| present.contains(key)) {
            true => Ok(()),
            false => refused!(
                "a {name} has {}: add those that are missing",
                listed(needs, "and")
            ),
        }
    }

    /// The pixels of its region in frames of (width, height); none of a section, whose region is as
    /// wide as the part's distance makes it, which is planned.
    ///
    /// # Errors
    /// In words, with its name: it has no region in the frame.
    pub(crate) fn pixels(&self, (width, height): (usize, usize)) -> Result<Region, Refusal> {
        if self.cut().is_some() {
            return Ok(Region::default());
        }
        let corners: Vec<_> = self.region.iter().map(|&[u, v]| (u, v)).collect();
        Region::polygon(&corners, width, height)
            .map_err(|error| format!("feature {:?}: {error}", self.name).into())
    }

    /// The feature of `all` features of a recipe, in frames of (width, height).
    ///
    /// # Errors
    /// As [`Self::pixels`].
    pub(crate) fn checked(&self, all: &[Self], size: (usize, usize)) -> Result<Feature, Refusal> {
        let plane = self.plane.as_ref();
        let plane = plane.and_then(|name| all.iter().position(|feature| feature.name == *name));
        let rim_of_plane = || all.get(plane?)?.rim_mm;
        Ok(Feature {
            kind: self.kind,
            region: self.pixels(size)?,
            plane,
            rim: self.rim_mm.or_else(rim_of_plane).unwrap_or(UNKNOWN_RIM_MM),
            thickness: self.thickness_mm,
            cut: self.cut(),
        })
    }

    /// Where a section is; `None` of other kinds, and where a key is missing.
    fn cut(&self) -> Option<Cut> {
        Some(Cut {
            from: self.from?,
            to: self.to?,
            width_mm: self.width_mm?,
            left: self.left?,
            right: self.right?,
            edge_mm: self.edge_mm,
            edge_tolerance_mm: self.edge_tolerance_mm,
        })
    }
}

/// Checks that the numbers of a section fit each other.
fn check_section(cut: &Cut) -> Result<(), Refusal> {
    if cut.from == cut.to {
        return Err("from and to are the same place: a section has a length".into());
    }
    if !(cut.width_mm > 0.0) {
        return refused!("width_mm is {}: write more than 0", cut.width_mm);
    }
    if cut.edge_mm == Some(0.0) {
        return Err("edge_mm is 0: write more, or leave it out".into());
    }
    for (key, stretch) in [("left", cut.left), ("right", cut.right)] {
        if stretch[0] >= stretch[1] {
            return refused!("{key} is {stretch:?}: write where it begins and where it ends");
        }
    }
    match cut.left[1] <= cut.right[0] {
        true => Ok(()),
        false => Err("left ends behind the beginning of right: both lie beside the joint".into()),
    }
}

impl DatumFile {
    /// As for features.
    ///
    /// # Errors
    /// As for features.
    pub(crate) fn check_bounds(&self) -> Result<(), Refusal> {
        Fields.check("", self)?;
        length("of", self.of.len(), 1, MAX_OF)?;
        let mut names = self.of.iter();
        Ok(names.try_for_each(|name| text("of", name, LONGEST_NAME))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A feature with what its form says must be there, in the middle of what may be.
    fn made(kind: &Value, all: bool) -> FeatureFile {
        let mut keys = json!({ "name": "a", "kind": kind["kind"] });
        if kind["shapes"][0] != "section" {
            keys["region"] = json!([[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]]);
        }
        for (at, parameter) in kind["parameters"].as_array().unwrap().iter().enumerate() {
            if parameter["optional"] == true && !all {
                continue;
            }
            let name = parameter["name"].as_str().unwrap();
            let most = parameter["most"].as_f64().unwrap_or(100.0);
            // Stretches of a section follow each other.
            let number = most * (at as f64 + 1.0) / 10.0;
            keys[name] = match (parameter["features"].is_array(), parameter["count"] == 2) {
                (true, _) => "sheet".into(),
                (_, true) => json!([number, number + most / 100.0]),
                (_, false) => number.into(),
            };
        }
        serde_json::from_value(keys).unwrap()
    }

    #[test]
    fn a_feature_with_the_keys_of_its_form_is_one_and_with_another_it_is_none() {
        for kind in FeatureKind::ALL.map(|kind| KindRow::of(kind).json()) {
            for all in [false, true] {
                let feature = made(&kind, all);
                assert_eq!(feature.check_bounds(), Ok(()), "{kind}");
                let keys = serde_json::to_value(&feature).unwrap();
                for other in FeatureKind::ALL.map(|kind| KindRow::of(kind).json()) {
                    for parameter in other["parameters"].as_array().unwrap() {
                        let name = parameter["name"].as_str().unwrap();
                        let own = kind["parameters"].as_array().unwrap();
                        if own.iter().any(|of| of["name"] == parameter["name"]) {
                            continue;
                        }
                        let mut more = keys.clone();
                        more[name] =
                            serde_json::to_value(made(&other, true)).unwrap()[name].clone();
                        let more: FeatureFile = serde_json::from_value(more).unwrap();
                        assert!(more.check_bounds().is_err(), "{kind} {name}");
                    }
                }
            }
        }
    }

    #[test]
    fn gauges_of_a_kind_of_feature_are_those_that_take_it() {
        let all = FeatureKind::ALL.map(|kind| KindRow::of(kind).json());
        let of = |kind: &str| {
            let found = all.iter().find(|of| of["kind"] == kind).unwrap();
            found["gauges"].as_array().unwrap().clone()
        };
        assert!(of("circle").contains(&"diameter".into()));
        assert!(!of("line").contains(&"diameter".into()));
        assert!(of("section").contains(&"gap".into()));
        for kind in &all {
            assert!(!kind["gauges"].as_array().unwrap().is_empty(), "{kind}");
        }
    }
}
