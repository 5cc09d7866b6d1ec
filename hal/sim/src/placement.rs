//! How a part lies in front of a simulated head, and what it lies on and among: a floor, pins, clamps
//! and the next part, which stay where they are in the world when the part moves.

use super::optics::{Vector, along, dot, minus, plus, turn, turned, turned_back};
use super::trace::{Body, Hit, clip};
use hal::bounded;
use hal::bounds::{Fields, MAX_PLACEMENT_MM, MAX_ROTATION_DEG, MAX_TILT_DEG};

/// Number of the first face of what a part lies on and among: no part has so many.
const FACE: u16 = u16::MAX / 4;
/// What the darker squares of a print reflect, as a share of the lighter ones.
const INK: f64 = 0.3;
/// Shadow rays start at this distance from a surface, mm.
const LIFT_MM: f64 = 1e-4;

bounded! {
    /// How a part lies: rotated about x, then y (tilt), then z (rotation), then shifted.
    #[derive(Copy)]
    pub struct Placement: Default {
        /// Shift x, y, z in mm.
        pub shift_mm: [f64; 3] = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM,
        /// Tilt about x and about y, degrees.
        pub tilt_deg: [f64; 2] = -MAX_TILT_DEG..=MAX_TILT_DEG,
        /// Rotation about z, degrees.
        pub rotation_deg: f64 = -MAX_ROTATION_DEG..=MAX_ROTATION_DEG,
    }

    /// A matte floor without an end, and what stands on it.
    pub struct Ground: Default {
        /// What it reflects of the light that the part would reflect.
        pub albedo: f64 = 0.0..=1.0 => 0.35,
        /// How far it lies below the lowest point of the part as designed, mm, where its tilt does not
        /// lift or lower it.
        pub depth_mm: f64 = 0.0..=1000.0 => 20.0,
        /// Tilt about x and about y, degrees.
        pub tilt_deg: [f64; 2] = -45.0..=45.0,
        /// Side of the squares of a printed checkerboard, mm; 0 is no print.
        pub print_mm: f64 = 0.0..=1000.0,
        /// Pins that stand on it, as bright as the part.
        pub pins: Vec<Pin> = Fields,
        /// Clamps, as bright as the part.
        pub clamps: Vec<Clamp> = Fields,
        /// Shift in x and y from the designed part to another one like it, mm; none without.
        pub next_mm: Option<[f64; 2]> = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM,
    }

    /// An upright cylinder.
    #[derive(Copy)]
    pub struct Pin: Default {
        /// x of its axis, mm.
        pub x: f64 = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM,
        /// y of its axis, mm.
        pub y: f64 = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM,
        /// Diameter, mm.
        pub diameter_mm: f64 = 0.1..=1000.0 => 8.0,
        /// How far its top lies above the floor, mm.
        pub height_mm: f64 = 0.1..=1000.0 => 20.0,
    }

    /// An upright block.
    #[derive(Copy)]
    pub struct Clamp: Default {
        /// Its lowest corner, mm.
        pub low: [f64; 3] = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM => [-10.0; 3],
        /// Its highest corner, mm.
        pub high: [f64; 3] = -MAX_PLACEMENT_MM..=MAX_PLACEMENT_MM => [10.0; 3],
    }
}

impl Placement {
    /// Where a point of the part, in its own coordinates, lies in the world, mm.
    #[must_use]
    pub fn to_world(&self, point: Vector) -> Vector {
        self.pose().to_world(point)
    }

    /// Rotation and shift, computed once for all points.
    pub(crate) fn pose(&self) -> Pose {
        let [x, y] = self.tilt_deg;
        Pose {
            rotation: turn([x, y, self.rotation_deg]),
            shift: self.shift_mm,
        }
    }
}

/// How a part lies: X_world = R · X_part + t.
pub(crate) struct Pose {
    /// Rz(rotation) · Ry(tilt y) · Rx(tilt x), row-major.
    pub rotation: [f64; 9],
    /// mm.
    pub shift: Vector,
}

impl Pose {
    /// A point of the part in the coordinates of the world.
    pub fn to_world(&self, point: Vector) -> Vector {
        plus(turned(&self.rotation, point), self.shift)
    }

    /// A point of the world in the coordinates of the part.
    pub fn to_part(&self, point: Vector) -> Vector {
        turned_back(&self.rotation, minus(point, self.shift))
    }
}

/// The world around a part.
pub(crate) struct World<'a> {
    albedo: f64,
    print_mm: f64,
    /// Where the floor crosses the z axis, its unit normal, and two directions in it.
    point: Vector,
    axes: [Vector; 3],
    pins: Vec<Pin>,
    clamps: Vec<Clamp>,
    next: Option<(&'a dyn Body, Vector)>,
}

impl<'a> World<'a> {
    /// The world below a part whose lowest point as designed, wherever it lies, is at z = `lowest`, with
    /// another one like it.
    pub fn below(lowest: f64, ground: &Ground, another: Option<&'a dyn Body>) -> Self {
        let [x, y] = ground.tilt_deg;
        let turn = turn([x, y, 0.0]);
        let next = ground.next_mm.zip(another);
        Self {
            albedo: ground.albedo,
            print_mm: ground.print_mm,
            point: [0.0, 0.0, lowest - ground.depth_mm],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                .map(|axis| turned(&turn, axis)),
            pins: ground.pins.clone(),
            clamps: ground.clamps.clone(),
            next: next.map(|([x, y], body)| (body, [x, y, 0.0])),
        }
    }

    /// The first point of the world on a ray: the distance, and the hit, in the world's coordinates.
    fn first(&self, origin: Vector, direction: Vector) -> Option<(f64, Hit)> {
        let solids = self.solid(origin, direction);
        let hits = solids.into_iter().chain(self.floor(origin, direction));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn floor(&self, origin: Vector, direction: Vector) -> Option<(f64, Hit)> {
        let [right, up, normal] = self.axes;
        let above = dot(normal, minus(origin, self.point));
        let t = -above / dot(normal, direction);
        let is_met = above > 0.0 && t > 0.0 && t.is_finite();
        is_met.then(|| {
            let point = along(origin, direction, t);
            let square = |axis| (dot(axis, minus(point, self.point)) / self.print_mm).floor();
            let is_inked =
                self.print_mm > 0.0 && (square(right) + square(up)).rem_euclid(2.0) != 0.0;
            let albedo = self.albedo * if is_inked { INK } else { 1.0 };
            (t, hit(point, normal, albedo, 2 * u16::from(is_inked)))
        })
    }

    /// The first point of what stands on the floor.
    fn solid(&self, origin: Vector, direction: Vector) -> Option<(f64, Hit)> {
        let pins = self.pins.iter().filter_map(|pin| {
            let foot = self.height(pin.x, pin.y);
            cylinder(pin, foot, origin, direction)
        });
        let clamps = self
            .clamps
            .iter()
            .filter_map(|clamp| block(clamp, origin, direction));
        let next = self.next.and_then(|(body, shift)| {
            let mut found = body.first_hit(minus(origin, shift), direction)?;
            found.point = plus(found.point, shift);
            found.face += FACE + 8;
            Some((dot(minus(found.point, origin), direction), found))
        });
        let solids = pins.chain(clamps).chain(next);
        solids.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// z of the floor.
    fn height(&self, x: f64, y: f64) -> f64 {
        let [a, b, c] = self.axes[2];
        self.point[2] - (a * x + b * y) / c
    }

    /// Where a ray of the world meets it: the distance, and the hit in the coordinates of the part.
    pub fn meets(&self, origin: Vector, direction: Vector, part: &Pose) -> Option<(f64, Hit)> {
        let (t, mut hit) = self.first(origin, direction)?;
        hit.point = part.to_part(hit.point);
        hit.normal = turned_back(&part.rotation, hit.normal);
        Some((t, hit))
    }

    /// Whether something on the floor lies between a point of the world and a distant one in direction `towards`.
    pub fn shades(&self, point: Vector, normal: Vector, towards: Vector) -> bool {
        let start = along(point, normal, LIFT_MM);
        self.solid(start, towards).is_some()
    }
}

fn hit(point: Vector, normal: Vector, albedo: f64, face: u16) -> Hit {
    Hit {
        point,
        normal,
        albedo,
        face: FACE + face,
    }
}

/// Where a ray enters a pin that stands at this height.
fn cylinder(pin: &Pin, foot: f64, origin: Vector, direction: Vector) -> Option<(f64, Hit)> {
    let (radius, top) = (pin.diameter_mm / 2.0, foot + pin.height_mm);
    let [x, y, z] = minus(origin, [pin.x, pin.y, 0.0]);
    let [dx, dy, dz] = direction;
    let (a, b, c) = (
        dx * dx + dy * dy,
        x * dx + y * dy,
        x * x + y * y - radius * radius,
    );
    let t = (-b - (b * b - a * c).sqrt()) / a;
    let at = along(origin, direction, t);
    if t > 0.0 && (foot..=top).contains(&at[2]) {
        let normal = [(at[0] - pin.x) / radius, (at[1] - pin.y) / radius, 0.0];
        return Some((t, hit(at, normal, 1.0, 4)));
    }
    let t = (top - z) / dz;
    let at = along(origin, direction, t);
    let is_top = dz < 0.0 && t > 0.0 && (at[0] - pin.x).hypot(at[1] - pin.y) <= radius;
    is_top.then(|| (t, hit(at, [0.0, 0.0, 1.0], 1.0, 5)))
}

/// Where a ray enters a clamp.
fn block(clamp: &Clamp, origin: Vector, direction: Vector) -> Option<(f64, Hit)> {
    let (t, _) = clip(&[clamp.low, clamp.high], origin, direction)?;
    let point = along(origin, direction, t);
    // The side on which the point lies.
    let off = |axis: usize| {
        let off = [clamp.low, clamp.high].map(|corner| (point[axis] - corner[axis]).abs());
        off[0].min(off[1])
    };
    let axis = (0..3).min_by(|a, b| off(*a).total_cmp(&off(*b)))?;
    let mut normal = [0.0; 3];
    normal[axis] = -direction[axis].signum();
    (t > 0.0).then(|| (t, hit(point, normal, 1.0, 6)))
}

impl Hit {
    /// Whether it is of the world around the part.
    pub fn is_of_world(&self) -> bool {
        self.face >= FACE
    }
}
