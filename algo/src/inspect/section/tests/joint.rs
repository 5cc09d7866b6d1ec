//! A renderer of sections: two sheets with rounded edges above a floor, in fringes.
//!
//! Rays are traced on a lattice much finer than pixels; what they send is blurred and integrated as
//! light, never as heights. It shares no code with what it judges.

use crate::inspect::section::{Optics, Request, SectionPoint};
use core::f64::consts::{PI, TAU};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::vec::Vec;

/// Counts of a face that is seen and lit head-on.
const LIGHT: f64 = 90.0;
/// The least modulation that is trusted, counts.
const LEAST: f64 = 9.0;
/// mm of depth per turn of the finest level.
const TURN: f64 = 10.0;
/// σ of each part of the demodulated light, counts: 1.5 of a sample, four shifts.
pub const NOISE: f64 = 1.06;
/// How far from the middle the section is seen, mm.
const HALF: f64 = 16.0;
/// Rays of a pixel along the section.
const RAYS: usize = 48;

pub type Pair = (f64, f64);

#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// From extreme point to extreme point along s if the sheets are not tilted, mm.
    pub gap: f64,
    /// The right sheet's height above the left's, mm.
    pub flush: f64,
    pub radii: [f64; 2],
    /// Rise of each sheet towards the joint, mm per mm.
    pub rises: [f64; 2],
    /// The middle of the gap, mm.
    pub place: f64,
    /// Depth and light of a floor, of the sheets'.
    pub floor: Option<(f64, f64)>,
    /// Which sheets there are.
    pub sheets: [bool; 2],
    pub pixel: f64,
    /// σ of the lens, px.
    pub blur: f64,
    /// Rows of pixels across the section's width, and by how much each lies farther along, px.
    pub rows: usize,
    pub turn: f64,
    pub sight: f64,
    pub light: f64,
}

pub struct Chance(SplitMix64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Two independent normal numbers.
    pub fn normal(&mut self) -> Pair {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let angle = TAU * self.unit();
        (radius * angle.cos(), radius * angle.sin())
    }
}

/// A sheet whose edge points to larger s.
#[derive(Clone, Copy)]
struct Sheet {
    along: Pair,
    normal: Pair,
    tangent: Pair,
    centre: Pair,
    radius: f64,
}

fn dot(a: Pair, b: Pair) -> f64 {
    a.0 * b.0 + a.1 * b.1
}

fn plus(a: Pair, b: Pair, times: f64) -> Pair {
    (a.0 + b.0 * times, a.1 + b.1 * times)
}

impl Sheet {
    /// With its extreme point at s, and height z at the middle of the stretches.
    fn new(s: f64, z: f64, radius: f64, rise: f64) -> Self {
        let h = (1.0 + rise * rise).sqrt();
        let (along, normal) = ((1.0 / h, rise / h), (-rise / h, 1.0 / h));
        let x = s - radius;
        let tangent = (x, z + rise * (x + 11.0));
        let centre = plus(tangent, normal, -radius);
        Self {
            along,
            normal,
            tangent,
            centre,
            radius,
        }
    }

    /// What a ray from q towards the camera meets last: how far along it, and the normal there.
    fn hit(&self, q: Pair, up: Pair) -> Option<(f64, Pair)> {
        let mut best: Option<(f64, Pair)> = None;
        let mut add = |way: f64, normal: Pair| {
            if best.is_none_or(|(far, _)| way > far) {
                best = Some((way, normal));
            }
        };
        let way = -dot(plus(q, self.tangent, -1.0), self.normal) / dot(up, self.normal);
        let at = plus(plus(q, up, way), self.tangent, -1.0);
        if dot(at, self.along) <= 0.0 {
            add(way, self.normal);
        }
        let from = plus(q, self.centre, -1.0);
        let (b, c) = (dot(from, up), dot(from, from) - self.radius * self.radius);
        if b * b >= c {
            let way = (b * b - c).sqrt() - b;
            let out = plus(from, up, way);
            let (x, y) = (dot(out, self.along), dot(out, self.normal));
            if x >= 0.0 && y >= 0.0 {
                add(way, (out.0 / self.radius, out.1 / self.radius));
            }
        }
        // The wall below the extreme point.
        let facing = dot(up, self.along);
        if facing > 1e-9 {
            let way = (self.radius - dot(from, self.along)) / facing;
            let depth = -dot(plus(from, up, way), self.normal);
            if (0.0..20.0).contains(&depth) {
                add(way, self.along);
            }
        }
        best
    }
}

fn mirrored(a: Pair) -> Pair {
    (-a.0, a.1)
}

/// The truth: gap and flush.
pub fn truth(joint: &Joint) -> (f64, f64) {
    let [left, right] = joint.both();
    let along = plus(left.along, mirrored(right.along), -1.0);
    let along = {
        let length = dot(along, along).sqrt();
        (along.0 / length, along.1 / length)
    };
    let from = plus(left.centre, along, left.radius);
    let to = plus(mirrored(right.centre), along, -right.radius);
    let high = plus(mirrored(right.tangent), left.tangent, -1.0);
    (dot(plus(to, from, -1.0), along), dot(high, left.normal))
}

impl Joint {
    pub fn draw(pixel: f64, chance: &mut Chance) -> Self {
        Self {
            gap: chance.between(2.0, 6.0),
            flush: chance.between(-1.0, 1.0),
            radii: [chance.between(1.0, 2.0), chance.between(1.0, 2.0)],
            rises: [chance.between(-0.02, 0.02), chance.between(-0.02, 0.02)],
            place: chance.between(-0.5, 0.5),
            floor: None,
            sheets: [true; 2],
            pixel,
            blur: 0.5,
            rows: (10.0 / pixel) as usize,
            turn: chance.between(-0.1, 0.1),
            sight: chance.between(-0.15, 0.15),
            light: chance.between(-0.35, 0.35),
        }
    }

    fn both(&self) -> [Sheet; 2] {
        let half = self.gap / 2.0;
        let [left, right] = self.radii;
        [
            Sheet::new(self.place - half, 0.0, left, self.rises[0]),
            Sheet::new(-self.place - half, self.flush, right, self.rises[1]),
        ]
    }

    pub fn request(&self) -> Request {
        Request {
            left: [-15.5, -6.0],
            right: [6.0, 15.5],
            edge_mm: [None; 2],
        }
    }

    pub fn optics(&self) -> Optics {
        Optics {
            blur: (self.blur * self.blur + 1.0 / 12.0).sqrt() * self.pixel,
            sight: self.sight,
            light: self.light,
        }
    }

    /// The light of a ray, and the height where it comes from.
    fn ray(&self, w: f64) -> Option<(f64, f64)> {
        let unit = |slope: f64| {
            let h = (1.0 + slope * slope).sqrt();
            (slope / h, 1.0 / h)
        };
        let (up, sun) = (unit(self.sight), unit(self.light));
        // The place at z = 0 that a ray w beside the middle passes.
        let q = (w / up.1, 0.0);
        let sheets = self.both();
        let mut best: Option<(f64, f64)> = None;
        let mut add = |way: f64, lit: f64| {
            if best.is_none_or(|(far, _)| way > far) {
                best = Some((way, lit));
            }
        };
        for (side, sheet) in sheets.iter().enumerate().filter(|(i, _)| self.sheets[*i]) {
            let turned = |a: Pair| if side == 0 { a } else { mirrored(a) };
            if let Some((way, normal)) = sheet.hit(turned(q), turned(up)) {
                let open = self.is_lit(plus(q, up, way), sun, 1 - side);
                let lit = dot(normal, turned(sun)).max(0.0) / sun.1;
                add(way, if open { lit } else { 0.0 });
            }
        }
        if let Some((depth, light)) = self.floor {
            let way = -depth / up.1;
            let at = plus(q, up, way);
            let open = self.is_lit(at, sun, 0) && self.is_lit(at, sun, 1);
            add(way, if open { light } else { 0.0 });
        }
        best.map(|(way, lit)| (lit * LIGHT, way * up.1))
    }

    /// Whether a sheet leaves light to a point.
    fn is_lit(&self, at: Pair, sun: Pair, side: usize) -> bool {
        if !self.sheets[side] {
            return true;
        }
        let turned = |a: Pair| if side == 0 { a } else { mirrored(a) };
        let (sheet, at, sun) = (&self.both()[side], turned(at), turned(sun));
        let from = plus(at, sheet.centre, -1.0);
        // Below the extreme point the wall is in the way, above it the circle.
        let below = dot(from, sheet.along) - dot(from, sheet.normal) * sun.0 / sun.1;
        let nearest = plus(from, sun, -dot(from, sun));
        let above = dot(from, sun) > 0.0 || dot(nearest, nearest) > sheet.radius * sheet.radius;
        dot(from, sheet.normal) > 0.0 || (below > sheet.radius && above)
    }

    pub fn rendered(&self) -> Rendered {
        let step = self.pixel / RAYS as f64;
        let reach = (HALF / step) as i32;
        let rays: Vec<_> = (-reach..=reach)
            .map(|i| self.ray(f64::from(i) * step))
            .collect();
        // A pixel under the lens' blur: a difference of two normal distribution functions.
        let density = |px: f64| {
            let part = |n: i32| {
                let off = (f64::from(n) + 0.5) / 24.0 - 0.5;
                (-0.5 * ((px - off) / self.blur).powi(2)).exp()
            };
            (0..24).map(part).sum::<f64>()
        };
        let half = (2.5 * RAYS as f64) as i32;
        let kernel: Vec<f64> = (-half..=half)
            .map(|i| density(f64::from(i) / RAYS as f64))
            .collect();
        let total: f64 = kernel.iter().sum();
        let mut light = Vec::new();
        for middle in half as usize..rays.len() - half as usize {
            let (mut re, mut im, mut sum, mut height) = (0.0, 0.0, 0.0, 0.0);
            for (k, ray) in kernel.iter().zip(&rays[middle - half as usize..]) {
                let Some((lit, z)) = ray else { continue };
                let (sin, cos) = (TAU * z / TURN).sin_cos();
                re += k * lit * cos;
                im += k * lit * sin;
                sum += k * lit;
                height += k * lit * z;
            }
            light.push(Light {
                re: re / total,
                im: im / total,
                height: if sum > 0.0 { height / sum } else { 0.0 },
            });
        }
        Rendered {
            joint: *self,
            from: f64::from(half - reach) * step,
            step,
            light,
        }
    }
}

/// What a pixel at some place gets: demodulated light, and the mean height, which says the order.
#[derive(Clone, Copy)]
struct Light {
    re: f64,
    im: f64,
    height: f64,
}

pub struct Rendered {
    pub joint: Joint,
    from: f64,
    step: f64,
    light: Vec<Light>,
}

impl Rendered {
    /// The points of a capture; `noise` times the camera's.
    pub fn capture(&self, seed: u64, noise: f64) -> Vec<SectionPoint> {
        let joint = &self.joint;
        let mut chance = Chance::new(seed);
        let columns = (2.0 * HALF / joint.pixel) as usize;
        let up = 1.0 / (1.0 + joint.sight * joint.sight).sqrt();
        let mut points = Vec::new();
        for row in 0..joint.rows {
            for column in 0..columns {
                let px = column as f64 + (row as f64 * joint.turn).rem_euclid(1.0);
                let w = px * joint.pixel - HALF;
                let at = (w - self.from) / self.step;
                let Some(light) = self.light.get(at.round() as usize).filter(|_| at >= 0.0) else {
                    continue;
                };
                let w = at.round() * self.step + self.from;
                let (one, other) = chance.normal();
                let re = light.re + noise * NOISE * one;
                let im = light.im + noise * NOISE * other;
                let modulation = re.hypot(im);
                if modulation < LEAST {
                    continue;
                }
                let z = im.atan2(re) / TAU * TURN;
                let z = z + ((light.height - z) / TURN).round() * TURN;
                let sigma = NOISE * TURN / (2.0 * PI * modulation);
                points.push(SectionPoint {
                    s: w / up + joint.sight * z,
                    z,
                    variance: sigma * sigma,
                });
            }
        }
        points
    }
}
