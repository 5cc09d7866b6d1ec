//! The light of a round body, and by way of a flat face, under one lamp, by Phong's model (1975), in plain `f64`: ambient +
//! pattern · (diffuse · n·l + specular · (r·v)^shininess).

use super::device::{Device, Point};

/// A sphere, or with an axis an endless cylinder.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// The centre, or a point on the axis.
    pub centre: Point,
    /// Its radius, mm.
    pub radius: f64,
    /// The direction of the axis, of length 1.
    pub axis: Option<Point>,
}

/// How it reflects.
#[derive(Clone, Copy, Debug)]
pub struct Phong {
    /// Light that is there without a lamp.
    pub ambient: f64,
    /// Share that goes everywhere.
    pub diffuse: f64,
    /// Share that is mirrored.
    pub specular: f64,
    /// Exponent of the mirrored light.
    pub shininess: f64,
}

/// A point of the body that is seen.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Where it is.
    pub at: Point,
    /// The outward normal.
    pub normal: Point,
    /// What comes from it to the eye without the lamp, and from the lamp if that is white: of the
    /// diffuse and of the mirrored light.
    pub light: [f64; 3],
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a + s · b.
fn plus(a: Point, s: f64, b: Point) -> Point {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: Point) -> Point {
    plus([0.0; 3], 1.0 / dot(a, a).sqrt(), a)
}

/// A flat face, a parallelogram.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// A corner.
    pub corner: Point,
    /// The sides that begin there.
    pub sides: [Point; 2],
}

impl Face {
    /// Where a ray crosses it: the distance, the point and the normal on that side of the sides a × b.
    pub fn crossed(&self, eye: Point, ray: Point) -> Option<(f64, Point, Point)> {
        let [a, b] = self.sides;
        let normal = cross(a, b);
        let t = dot(normal, plus(self.corner, -1.0, eye)) / dot(normal, ray);
        let off = plus(plus(eye, t, ray), -1.0, self.corner);
        let share = |side: Point, other: Point| {
            let across = cross(normal, other);
            dot(off, across) / dot(side, across)
        };
        let inside = |share: f64| (0.0..1.0).contains(&share);
        let met = t > 0.0 && inside(share(a, b)) && inside(share(b, a));
        met.then(|| (t, plus(eye, t, ray), unit(normal)))
    }
}

impl Phong {
    /// The light that a point with this normal gets from a lamp in direction `from`, and that goes on in direction
    /// `to`.
    fn reflected(&self, normal: Point, from: Point, to: Point) -> f64 {
        let along = dot(normal, from);
        if along <= 0.0 {
            return 0.0;
        }
        let mirrored = plus(plus([0.0; 3], 2.0 * along, normal), -1.0, from);
        self.diffuse * along + self.specular * dot(mirrored, to).max(0.0).powf(self.shininess)
    }

    /// What a point with this normal that is seen from `eye` gets by way of a face that the lamp lights, as the
    /// integral over the face of I / π · reflected · cos / r² dA, with so many places along each side.
    pub fn by_way_of(
        &self,
        (at, normal): (Point, Point),
        (eye, lamp): (Point, Point),
        face: &Face,
        places: u32,
    ) -> f64 {
        let [a, b] = face.sides;
        let across = cross(a, b);
        let area = dot(across, across).sqrt() / f64::from(places * places);
        let outwards = unit(across);
        let share = |step: u32| (f64::from(step) + 0.5) / f64::from(places);
        let to_eye = unit(plus(eye, -1.0, at));
        let mut sum = 0.0;
        for step in 0..places * places {
            let place = plus(face.corner, share(step % places), a);
            let place = plus(place, share(step / places), b);
            let way = plus(place, -1.0, at);
            let from = unit(way);
            let lit = self.reflected(
                outwards,
                unit(plus(lamp, -1.0, place)),
                plus([0.0; 3], -1.0, from),
            );
            // The light of a small source is reflected as if it came perpendicularly: without the cosine here.
            let on = self.reflected(normal, from, to_eye);
            let seen = -dot(outwards, from) / dot(way, way);
            sum += lit * on * seen.max(0.0) * area / std::f64::consts::PI;
        }
        sum
    }
}

impl Body {
    /// Without what lies along the axis.
    fn across(&self, d: Point) -> Point {
        self.axis.map_or(d, |axis| plus(d, -dot(d, axis), axis))
    }

    /// The point that the ray of camera point (u, v) meets first: |c + s·d|² = R², with everything
    /// across the axis.
    pub fn seen(&self, camera: &Device, u: f64, v: f64) -> Option<(Point, Point)> {
        let (eye, ray) = (camera.centre(), camera.ray(u, v));
        let c = self.across(plus(eye, -1.0, self.centre));
        let d = self.across(ray);
        let (half, rest) = (dot(c, d), dot(c, c) - self.radius * self.radius);
        let root = half * half - dot(d, d) * rest;
        if root < 0.0 {
            return None;
        }
        let at = plus(eye, (-half - root.sqrt()) / dot(d, d), ray);
        Some((at, unit(self.across(plus(at, -1.0, self.centre)))))
    }

    /// What the camera sees of it at (u, v) with the lamp in the centre of the projector.
    pub fn lit(
        &self,
        phong: &Phong,
        camera: &Device,
        lamp: &Device,
        (u, v): (f64, f64),
    ) -> Option<Spot> {
        let (at, normal) = self.seen(camera, u, v)?;
        let to_lamp = unit(plus(lamp.centre(), -1.0, at));
        let to_eye = unit(plus(camera.centre(), -1.0, at));
        let along = dot(normal, to_lamp);
        if along <= 0.0 {
            return Some(Spot {
                at,
                normal,
                light: [phong.ambient, 0.0, 0.0],
            });
        }
        // The mirrored direction has the same part along the normal, and the opposite one across
        // it.
        let across = plus(to_lamp, -along, normal);
        let mirrored = plus(plus([0.0; 3], along, normal), -1.0, across);
        let highlight = dot(mirrored, to_eye).max(0.0).powf(phong.shininess);
        let light = [
            phong.ambient,
            phong.diffuse * along,
            phong.specular * highlight,
        ];
        Some(Spot { at, normal, light })
    }
}
