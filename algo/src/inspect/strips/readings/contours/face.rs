//! How the camera sees the plane of a face, and what light it has there.

use super::light::{GoldenSignal, Levels, Signal};
use crate::geometry::{Triangulator, Vector};
use crate::inspect::contour::{PlaneSpot, PlaneView};
use crate::inspect::feature::PlaneFrame;
use crate::inspect::strips::golden::{Near, NodeRow};
use crate::math::complex::Complex;

/// The plane of a face as it lies now.
#[derive(Clone, Debug)]
pub struct Face<'a> {
    pub triangulator: &'a Triangulator,
    /// Columns and rows of the frame.
    pub size: (usize, usize),
    /// The frame of the plane in the world.
    pub frame: PlaneFrame,
    pub levels: &'a Levels,
    pub golden: &'a GoldenSignal,
    pub light: Signal<'a>,
    /// What is known of lines of sight near the contour; they are worked out elsewhere.
    pub near: Near<3>,
}

impl Face<'_> {
    /// Works out the lines of sight within `reach` px of these places of the plane.
    pub fn look_about(&mut self, places: impl Iterator<Item = (f64, f64)>, reach: f64) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (u, v) in places.filter_map(|(x, y)| self.pixel(x, y)) {
            low = [low[0].min(u - reach), low[1].min(v - reach)];
            high = [high[0].max(u + reach), high[1].max(v + reach)];
        }
        // The frame, and what lies beside its border.
        let low = low.map(|low| libm::floor(low).max(-1.0));
        let (width, height) = (self.size.0 as f64, self.size.1 as f64);
        let high = (high[0].min(width), high[1].min(height));
        if low[0] < high.0 && low[1] < high.1 {
            self.near = Near::new((low[0], low[1]), high, |u, v| self.exact(u, v));
        }
    }

    /// What the line of sight through (u, v) meets: x, y and phase.
    fn exact(&self, u: f64, v: f64) -> Option<[f64; 3]> {
        let point = self.point(u, v, 0.0)?;
        let phase = self.triangulator.phase_at(point)?;
        let from = self.frame.coordinates(point);
        phase.is_finite().then_some([from.x, from.y, phase])
    }

    /// The point of a line of sight that lies `below` mm below the plane.
    fn point(&self, u: f64, v: f64, below: f64) -> Option<Vector> {
        let camera = self.triangulator.camera();
        let (eye, ray) = (camera.centre(), camera.ray(u, v)?);
        let normal = self.frame.normal();
        let way = (normal.dot(self.frame.origin - eye) - below) / normal.dot(ray);
        (way > 0.0 && way.is_finite()).then(|| eye + ray * way)
    }

    /// The length of a pixel at a place of the plane, mm.
    pub fn spot_size(&self, x: f64, y: f64) -> Option<f64> {
        let (u, v) = self.pixel(x, y)?;
        let (here, beside) = (self.spot(u, v)?, self.spot(u + 1.0, v)?);
        Some(libm::hypot(beside.x - here.x, beside.y - here.y))
    }

    /// By how much the phase is larger for a mm below the plane at a place of the plane, turns.
    pub fn turns_per_mm(&self, x: f64, y: f64) -> Option<f64> {
        let (u, v) = self.pixel(x, y)?;
        let phase = |below| self.triangulator.phase_at(self.point(u, v, below)?);
        Some((phase(0.5)? - phase(-0.5)?).clamp(-1e3, 1e3))
    }
}

impl PlaneView for Face<'_> {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    #[inline]
    fn spot(&self, u: f64, v: f64) -> Option<PlaneSpot> {
        let near = self.near.at(u, v);
        near.or_else(|| self.exact(u, v))
            .map(|[x, y, phase]| PlaneSpot { x, y, phase })
    }

    fn row(&self, v: f64) -> impl Fn(f64) -> Option<PlaneSpot> {
        let mut row = NodeRow::new();
        self.near.take_row(v, &mut row);
        move |u| {
            let near = self.near.in_row(&row, u);
            let [x, y, phase] = near.or_else(|| self.exact(u, v))?;
            Some(PlaneSpot { x, y, phase })
        }
    }

    fn pixel(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        self.triangulator.camera().project(self.frame.point(x, y))
    }

    fn signals(&self, (u, v): (usize, usize), level: usize, row: &mut [Complex]) {
        match self.light {
            Signal::Frames(frames, _) => self.levels.signals(frames, level, (u, v), row),
            Signal::Golden => {
                let first = v * self.size.0 + u;
                for (signal, place) in row.iter_mut().zip(first..) {
                    let golden = self.golden.at(place, self.levels.full_scale());
                    *signal = golden.unwrap_or(Complex::UNKNOWN);
                }
            }
            Signal::None => row.fill(Complex::UNKNOWN),
        }
    }
}
