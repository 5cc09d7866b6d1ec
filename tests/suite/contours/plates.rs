//! Plates with holes, a slot and an edge, what is measured of them, and its true values.

use crate::placement::square_pixels;
use algo::geometry::{Pinhole, Vector};
use algo::inspect::kinds::{Diameter, Distance, Length, Position, Width, X, Y};
use algo::inspect::{FeatureKind, Measure};
use appliance::recipe::{DatumFile, FeatureFile, GaugeFile};
use sim::parts::{Floor, Hole, Plate, Slot};
use sim::scenario::Noise;
use sim::{Ground, Part, Placement, Scenario};
use tests::random::Random;

/// Largest displacement in each direction, and largest tilt and rotation.
const SHIFT_MM: f64 = 1.0;
const TILT_DEG: f64 = 1.0;
/// No corner of it moves farther.
const TOLERANCE_MM: f64 = 5.0;
/// z of the plate's upper side.
pub(crate) const Z_MM: f64 = 8.0;
/// A region reaches so far beyond its contour, mm.
pub(crate) const AROUND_MM: f64 = 2.5;

/// The plate: holes of 3 to 11 mm and a slot.
pub(crate) fn plate() -> Plate {
    let hole = |x, y, radius| Hole { x, y, radius };
    Plate {
        z: Z_MM,
        holes: vec![
            hole(-60.0, 40.0, 3.0),
            hole(55.0, 41.0, 5.0),
            hole(-60.0, -40.0, 6.0),
            hole(24.0, 2.0, 11.0),
        ],
        slots: vec![Slot {
            from: [-32.0, 30.0],
            to: [2.0, 30.0],
            half_width: 4.0,
        }],
        floor: Floor {
            albedo: 0.0,
            ..Floor::default()
        },
        ..Plate::default()
    }
}

/// The camera, and how the plate lies.
pub(crate) type View<'a> = (&'a Pinhole, &'a Placement);

/// The pixels of a polygon on the plate.
pub(crate) fn polygon((camera, lies): View<'_>, corners: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let seen = |&[x, y]: &[f64; 2]| {
        let [x, y, z] = lies.to_world([x, y, Z_MM]);
        let at = Vector::new(x, y, z);
        let (u, v) = camera.project(at).unwrap();
        [u, v]
    };
    corners.iter().map(seen).collect()
}

pub(crate) fn around(camera: View<'_>, [x, y]: [f64; 2], [a, b]: [f64; 2]) -> Vec<[f64; 2]> {
    let corner = |at: usize| {
        let turn = std::f64::consts::TAU * at as f64 / 16.0;
        [x + a * turn.cos(), y + b * turn.sin()]
    };
    polygon(camera, &(0..16).map(corner).collect::<Vec<_>>())
}

/// Features of a plate, and gauges with their true values.
pub(crate) fn gauging(
    plate: &Plate,
    camera: &Pinhole,
    lies: &Placement,
) -> (Vec<FeatureFile>, Vec<DatumFile>, Vec<(GaugeFile, f64)>) {
    let camera = (camera, lies);
    let (right, top) = (plate.width / 2.0 - 3.0, plate.height / 2.0 - 3.0);
    let corners = [[-right, -top], [right, -top], [right, top], [-right, top]];
    let mut features = vec![FeatureFile::new(
        "sheet",
        FeatureKind::Plane,
        polygon(camera, &corners),
    )];
    let in_sheet = |of: FeatureFile| FeatureFile {
        plane: Some("sheet".into()),
        ..of
    };
    let mut all: Vec<(GaugeFile, f64)> = Vec::new();
    let mut add =
        |name: String, measures: Measure, of: &[&str], datum: Option<&str>, truth: f64| {
            let slot = all.len() as u16 + 1;
            let gauge = GaugeFile {
                datum: datum.map(Into::into),
                ..GaugeFile::new(slot, &name, measures, of)
            };
            all.push((gauge, truth));
        };
    for (at, hole) in plate.holes.iter().enumerate() {
        let name = format!("hole {}", at + 1);
        let reach = hole.radius + AROUND_MM;
        let region = around(camera, [hole.x, hole.y], [reach; 2]);
        features.push(in_sheet(FeatureFile::new(
            &*name,
            FeatureKind::Circle,
            region,
        )));
        add(
            format!("diameter {}", at + 1),
            Diameter {}.into(),
            &[&name],
            None,
            2.0 * hole.radius,
        );
    }
    let slot = &plate.slots[0];
    let middle = [(slot.from[0] + slot.to[0]) / 2.0, slot.from[1]];
    let half = (slot.to[0] - slot.from[0]) / 2.0 + slot.half_width;
    let (x, y) = (half + AROUND_MM, slot.half_width + AROUND_MM);
    let corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(|[a, b]| [middle[0] + a, middle[1] + b]);
    features.push(in_sheet(FeatureFile::new(
        "slot",
        FeatureKind::Slot,
        polygon(camera, &corners),
    )));
    add(
        "length".into(),
        Length {}.into(),
        &["slot"],
        None,
        2.0 * half,
    );
    add(
        "width".into(),
        Width {}.into(),
        &["slot"],
        None,
        2.0 * slot.half_width,
    );
    let left = -plate.width / 2.0;
    let corners = [-30.0, 30.0].map(|y| [[left - 3.0, y], [left + 3.0, y]]);
    let corners = [corners[0][0], corners[0][1], corners[1][1], corners[1][0]];
    features.push(in_sheet(FeatureFile::new(
        "edge",
        FeatureKind::Line,
        polygon(camera, &corners),
    )));
    let [a, b, c, d] = plate.holes[..] else {
        panic!("four holes")
    };
    let distance = |one: Hole, other: Hole| (one.x - other.x).hypot(one.y - other.y);
    for (name, of, truth) in [
        ("1 to 2", ["hole 1", "hole 2"], distance(a, b)),
        ("3 to 4", ["hole 3", "hole 4"], distance(c, d)),
        ("edge to 4", ["edge", "hole 4"], d.x - left),
        (
            "slot to 3",
            ["slot", "hole 3"],
            (middle[0] - c.x).hypot(middle[1] - c.y),
        ),
    ] {
        add(name.into(), Distance {}.into(), &of, None, truth);
    }
    // Holes 1 and 2 make the frame.
    let (axis, length) = ([b.x - a.x, b.y - a.y], distance(a, b));
    let at = [
        ((d.x - a.x) * axis[0] + (d.y - a.y) * axis[1]) / length,
        ((d.y - a.y) * axis[0] - (d.x - a.x) * axis[1]) / length,
    ];
    add(
        "x of 4".into(),
        X {}.into(),
        &["hole 4"],
        Some("ABC"),
        at[0],
    );
    add(
        "y of 4".into(),
        Y {}.into(),
        &["hole 4"],
        Some("ABC"),
        at[1],
    );
    let nominal = [at[0] - 0.03, at[1] + 0.04];
    let position = Position { nominal };
    add(
        "position".into(),
        position.into(),
        &["hole 4"],
        Some("ABC"),
        0.1,
    );
    let datums = vec![DatumFile {
        name: "ABC".into(),
        of: ["sheet", "hole 1", "hole 2"].map(Into::into).to_vec(),
    }];
    (features, datums, all)
}

/// What plates are measured by.
#[derive(Clone)]
pub(crate) struct Setting {
    pub(crate) plate: Plate,
    /// Columns and rows of the camera.
    pub(crate) size: (u32, u32),
    /// σ of the blur of camera and projector, px.
    pub(crate) blur: [f64; 2],
    /// Ambient light over the part's.
    pub(crate) ambient: f64,
    /// Of the part as taught about y, degrees.
    pub(crate) tilt_deg: f64,
    pub(crate) thickness_mm: Option<f64>,
    /// Whether the plane says how the rims are.
    pub(crate) rims_stated: bool,
    /// Whether what golden does not show is left out.
    pub(crate) some: bool,
    /// Counts; `None` for a quiet camera.
    pub(crate) noise: Option<f64>,
    /// What the plate lies on and among.
    pub(crate) world: Option<Ground>,
}

impl Default for Setting {
    fn default() -> Self {
        Self {
            plate: plate(),
            size: (512, 512),
            blur: [0.0, 0.5],
            ambient: 0.04,
            tilt_deg: 0.0,
            thickness_mm: Some(0.0),
            rims_stated: true,
            some: false,
            noise: Some(Noise::PAPER),
            world: None,
        }
    }
}

impl Setting {
    pub(crate) fn scenario(&self) -> Scenario {
        let mut scenario = Scenario {
            part: Part::Plate(self.plate.clone()),
            floor: self.world.clone(),
            ..Scenario::default()
        };
        scenario.noise.noise_counts = self.noise;
        square_pixels(&mut scenario.rig.camera, self.size);
        scenario.optics.camera_blur_px = self.blur[0];
        scenario.optics.projector_blur_px = self.blur[1];
        // The camera is not overexposed.
        scenario.light.diffuse -= self.ambient - scenario.light.ambient;
        scenario.light.ambient = self.ambient;
        scenario
    }

    /// How far the corners of a part may lie from where it was taught, mm: by default among other things.
    pub(crate) fn tolerance_mm(&self) -> f64 {
        match self.world {
            Some(_) => 1.0,
            None => TOLERANCE_MM,
        }
    }

    /// The placement as taught, displaced at random.
    pub(crate) fn placement(&self, random: Option<&mut Random>) -> Placement {
        let mut lies = Placement {
            tilt_deg: [0.0, self.tilt_deg],
            ..Placement::default()
        };
        if let Some(random) = random {
            let reach = self.tolerance_mm() / TOLERANCE_MM;
            let mut between = |most: f64| reach * most * (2.0 * random.share() - 1.0);
            lies.shift_mm = [(); 3].map(|()| between(SHIFT_MM));
            lies.tilt_deg = lies.tilt_deg.map(|tilt| tilt + between(TILT_DEG));
            lies.rotation_deg = between(TILT_DEG);
            // What its floor touches stays on it.
            if self
                .world
                .as_ref()
                .is_some_and(|world| world.depth_mm == 0.0)
            {
                (lies.shift_mm[2], lies.tilt_deg) = (0.0, [0.0, self.tilt_deg]);
            }
        }
        lies
    }
}
