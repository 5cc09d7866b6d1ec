//! The light of a round body under one lamp, by Phong's model (1975), in plain `f64`: ambient +
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

fn unit(a: Point) -> Point {
    plus([0.0; 3], 1.0 / dot(a, a).sqrt(), a)
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
