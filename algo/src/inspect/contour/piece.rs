//! A contour in pieces of about two pixels, each with the pixels across it.
//!
//! The pixels are gathered row by row: rows of the picture cross the ring about the contour in runs,
//! which are read at once, each frame's samples in their order in memory. Between runs the distance
//! from the contour tells how far the next one is.

use super::beyond::{Gradient, Wall, border, shadow};
use super::light::{PlaneSpot, PlaneView, Setup, Signals};
use super::shape::{Foot, Parameters, Shape};
use crate::math::complex::Complex;
use alloc::vec::Vec;
use core::ops::Range;

/// Length of a piece, px.
pub const LENGTH: f64 = 2.0;
/// How far from the contour pixels are looked at, px.
pub const BAND: f64 = 5.0;
/// How far a contour may move until its pixels are gathered anew, px.
pub const MARGIN: f64 = 0.25;

/// A pixel of a piece.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Column and row.
    pub at: (usize, usize),
    /// Where it looks.
    pub spot: PlaneSpot,
    /// w, the sum of levels.
    pub light: Complex,
    /// The same with each level times its share of the mean ratio.
    pub rated: Complex,
    /// e^{iθ}: how a floor's phase turns `rated` light from the piece's middle to here, beyond the
    /// plane's.
    pub floor: Complex,
    /// Signed distance from the contour, px.
    pub d: f64,
    /// Signed distance from another border of the background, px; −∞ if there is none near.
    pub border: f64,
    /// The cosine between both.
    pub follow: f64,
    /// By how much the plane's phase changes across that border, turns of ratio 1 per px.
    pub gradient: f64,
}

/// A piece of a contour.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Its middle.
    pub foot: Foot,
    /// By how much d changes with u and with v, mm per px.
    pub across: (f64, f64),
    /// By how much the way along the contour changes with u and with v, mm per px.
    pub along: (f64, f64),
    /// By how much the plane's phase changes with u and with v, turns of ratio 1 per px.
    phase: (f64, f64),
    /// mm per px along d.
    pub scale: f64,
    /// The unit vector along d in the picture (u, v).
    pub normal: (f64, f64),
    /// By how much the plane's phase changes along d, turns of ratio 1 per px.
    pub gradient: f64,
    /// The wall, if it is seen; its width in px.
    pub wall: Option<Wall>,
    /// How wide a shadow lies between the edge and a floor, px per mm of the floor's depth; 0 or
    /// less if there is none.
    pub shadow: f64,
    /// Where its middle is seen; `None` if it is not.
    pub middle: Option<(f64, f64)>,
    /// How a floor's phase changes beside it; `None` if that is not known.
    pub floor: Option<Gradient>,
    /// Its pixels.
    pub pixels: Range<usize>,
}

/// All pieces of a contour, in their order along it.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// The pieces.
    pub all: Vec<Piece>,
    /// The pixels of all, piece by piece.
    pub pixels: Vec<Pixel>,
}

/// mm per px in the picture at a place of the plane: the lengths of the sides of a pixel.
pub fn pixel_size(view: &impl PlaneView, (x, y): (f64, f64)) -> Option<f64> {
    let [a, b] = frame(view, view.pixel(x, y)?)?.map(|(x, y, _)| (x, y));
    Some(libm::sqrt(libm::fabs(a.0 * b.1 - a.1 * b.0)))
}

/// How x, y and the plane's phase change with u and with v.
fn frame(view: &impl PlaneView, (u, v): (f64, f64)) -> Option<[(f64, f64, f64); 2]> {
    let change = |du: f64, dv: f64| {
        let (less, more) = (view.spot(u - du, v - dv)?, view.spot(u + du, v + dv)?);
        Some((more.x - less.x, more.y - less.y, more.phase - less.phase))
    };
    Some([change(0.5, 0.0)?, change(0.0, 0.5)?])
}

impl Pieces {
    /// Divides a contour into pieces, whose pixels are gathered elsewhere. What the camera does not
    /// see of it has pieces without a middle.
    pub fn divide(
        &mut self,
        (shape, p): (&dyn Shape, &Parameters),
        signals: &Signals<'_, impl PlaneView>,
        pixel: f64,
    ) {
        let length = shape.length(p);
        let (columns, rows) = signals.view.size();
        // Casts keep to the range of their type; a contour has fewer pieces than the frame pixels.
        let count = (length / (LENGTH * pixel) + 0.5) as usize;
        let count = count.clamp(1, (columns * rows).max(1));
        self.all.clear();
        for number in 0..count {
            let foot = shape.foot(p, length * (number as f64 + 0.5) / count as f64);
            let mut piece = Piece {
                foot,
                across: (0.0, 0.0),
                along: (0.0, 0.0),
                phase: (0.0, 0.0),
                scale: pixel,
                normal: (1.0, 0.0),
                gradient: 0.0,
                wall: None,
                shadow: 0.0,
                middle: None,
                floor: None,
                pixels: 0..0,
            };
            piece.middle = piece.orient(signals);
            if piece.middle.is_some() {
                let half = length / count as f64 / 2.0;
                piece.floor = Gradient::of_floor(signals, &foot, [BAND * piece.scale, half]);
            }
            self.all.push(piece);
        }
    }

    /// Moves one of `some` pieces to a contour that has hardly moved, and works out the distances of
    /// its pixels.
    pub fn place(
        &mut self,
        of: (&dyn Shape, &Parameters),
        setup: &Setup,
        thickness: f64,
        some: usize,
    ) {
        for piece in self.all.iter_mut().step_by(some) {
            let Foot { x, y, normal, .. } = piece.foot;
            let off = of.0.distance(of.1, x, y);
            (piece.foot.x, piece.foot.y) = (x - off * normal.0, y - off * normal.1);
            piece.wall = Wall::at(setup, thickness, (x, y), normal);
            if let Some(wall) = &mut piece.wall {
                wall.width /= piece.scale;
            }
            for pixel in &mut self.pixels[piece.pixels.clone()] {
                pixel.place(of, (setup, thickness), piece);
            }
        }
    }
}

impl Piece {
    /// Works out how it lies in the picture, and where its middle does; `None` if it is not seen.
    fn orient(&mut self, signals: &Signals<'_, impl PlaneView>) -> Option<(f64, f64)> {
        let Foot { x, y, normal, .. } = self.foot;
        let middle = signals.view.pixel(x, y)?;
        let [along_u, along_v] = frame(signals.view, middle)?;
        let part = |n: (f64, f64)| {
            let of = |(x, y, _): (f64, f64, f64)| n.0 * x + n.1 * y;
            (of(along_u), of(along_v))
        };
        self.across = part(normal);
        self.along = part((-normal.1, normal.0));
        self.phase = (along_u.2, along_v.2);
        self.scale = libm::sqrt(dot(self.across, self.across));
        self.normal = (self.across.0 / self.scale, self.across.1 / self.scale);
        self.gradient = dot(self.normal, self.phase);
        self.shadow = shadow(signals.setup, (x, y), normal) / self.scale;
        (self.scale > 0.0).then_some(middle)
    }
}

impl Pixel {
    fn place(
        &mut self,
        (shape, p): (&dyn Shape, &Parameters),
        (setup, thickness): (&Setup, f64),
        piece: &Piece,
    ) {
        let (x, y) = (self.spot.x, self.spot.y);
        self.d = shape.distance(p, x, y) / piece.scale;
        self.border = f64::NEG_INFINITY;
        let Some((border, at)) = border((shape, p), setup, thickness, (x, y)) else {
            return;
        };
        if border < -BAND * piece.scale {
            return;
        }
        // How the border's distance changes along the contour's normal, and along the contour.
        let step = 1e-3 * piece.scale;
        let change = |(x, y): (f64, f64)| {
            let ahead = shape.distance(p, at.0 + step * x, at.1 + step * y);
            (ahead - border) / step
        };
        let normal = piece.foot.normal;
        let (n, t) = (change(normal), change((-normal.1, normal.0)));
        let across = (
            n * piece.across.0 + t * piece.along.0,
            n * piece.across.1 + t * piece.along.1,
        );
        let scale = libm::sqrt(dot(across, across));
        (self.border, self.follow) = (border / scale, n);
        self.gradient = dot(across, piece.phase) / scale;
    }
}

/// The scalar product.
pub fn dot(a: (f64, f64), b: (f64, f64)) -> f64 {
    a.0 * b.0 + a.1 * b.1
}

/// How much larger a pixel may be elsewhere in the ring than at any piece.
const LARGER: f64 = 1.25;

/// Buffers for gathering.
#[derive(Clone, Debug, Default)]
pub struct Ring {
    /// What the pixels of a run look at, and how far from the contour, mm.
    run: Vec<(PlaneSpot, f64)>,
    /// The light of a run.
    light: Vec<Complex>,
    /// Pixels row by row, each with the number of its piece.
    found: Vec<(usize, Pixel)>,
}

impl Ring {
    /// Gathers the pixels within the band of each piece that look at places nearest to it, piece by
    /// piece.
    pub fn gather(
        &mut self,
        (shape, p): (&dyn Shape, &Parameters),
        signals: &Signals<'_, impl PlaneView>,
        Pieces {
            all: pieces,
            pixels,
        }: &mut Pieces,
    ) {
        self.found.clear();
        let (columns, rows) = signals.view.size();
        // The largest pieces' band, mm, and the most that a step of one column moves on the plane.
        let (mut band, mut step) = (0.0_f64, 0.0_f64);
        for piece in pieces.iter().filter(|piece| piece.middle.is_some()) {
            band = band.max((BAND + MARGIN) * piece.scale);
            step = step.max(LARGER * libm::hypot(piece.across.0, piece.along.0));
        }
        let about = |of: fn((f64, f64)) -> f64, end: usize| {
            let middles = pieces.iter().filter_map(|piece| piece.middle);
            let (low, high) = middles.fold((f64::INFINITY, 0.0_f64), |(low, high), middle| {
                (low.min(of(middle)), high.max(of(middle)))
            });
            let reach = LARGER * BAND + 2.0;
            whole((low - reach, high + reach), end)
        };
        let (across, down) = (about(|at| at.0, columns), about(|at| at.1, rows));
        for v in down {
            let spot = signals.view.row(v as f64);
            let mut u = across.start;
            while u < across.end {
                let at = spot(u as f64);
                let d = at.map(|at| shape.distance(p, at.x, at.y));
                let beyond = d.map_or(0.0, |d| libm::fabs(d) - band);
                match at.zip(d) {
                    Some(here) if beyond <= 0.0 => {
                        self.run.push(here);
                        u += 1;
                    }
                    _ => {
                        self.take((shape, p), signals, (u, v), pieces);
                        // Casts cut off, and keep to the range of their type.
                        u = u.saturating_add(((beyond / step) as usize).max(1));
                    }
                }
            }
            self.take((shape, p), signals, (across.end, v), pieces);
        }
        self.sort(pieces, pixels);
    }

    /// Takes the light of the run that ends before a pixel.
    fn take(
        &mut self,
        (shape, p): (&dyn Shape, &Parameters),
        signals: &Signals<'_, impl PlaneView>,
        (end, v): (usize, usize),
        pieces: &[Piece],
    ) {
        let count = self.run.len();
        if count == 0 {
            return;
        }
        let start = end - count;
        signals.read((start, v), count, &mut self.light);
        let length = shape.length(p) / pieces.len() as f64;
        let per_ratio = signals.ratio * signals.leading;
        for (at, (spot, d)) in self.run.drain(..).enumerate() {
            let Some(along) = shape.along(p, spot.x, spot.y) else {
                continue;
            };
            // Casts cut off, and keep to the range of their type.
            let number = ((along / length) as usize).min(pieces.len() - 1);
            let piece = &pieces[number];
            if piece.middle.is_none() || libm::fabs(d) > (BAND + MARGIN) * piece.scale {
                continue;
            }
            let levels = self.light.iter().skip(at).step_by(count).copied();
            let Some([light, rated]) = signals.light(levels, &spot) else {
                continue;
            };
            let t = along - (number as f64 + 0.5) * length;
            let floor = piece.floor.map(|floor| per_ratio * floor.turns(d, t));
            let pixel = Pixel {
                at: (start + at, v),
                spot,
                light,
                rated,
                floor: floor.map_or(Complex::new(1.0, 0.0), Complex::turned),
                d: 0.0,
                border: f64::NEG_INFINITY,
                follow: 1.0,
                gradient: 0.0,
            };
            self.found.push((number, pixel));
        }
    }

    /// Sorts the pixels by their pieces, in each in the order in which they were found.
    fn sort(&self, pieces: &mut [Piece], pixels: &mut Vec<Pixel>) {
        for (number, _) in &self.found {
            pieces[*number].pixels.end += 1;
        }
        let mut end = 0;
        for piece in pieces.iter_mut() {
            let start = end;
            end += piece.pixels.end;
            piece.pixels = start..start;
        }
        pixels.clear();
        pixels.extend(self.found.iter().map(|(_, pixel)| *pixel));
        for (number, pixel) in &self.found {
            let own = &mut pieces[*number].pixels;
            pixels[own.end] = *pixel;
            own.end += 1;
        }
    }
}

/// The whole numbers below `end` within a range.
fn whole((low, high): (f64, f64), end: usize) -> Range<usize> {
    // Casts cut off, and keep to the range of their type.
    let after = |at: f64| (at.max(-1.0) + 1.0) as usize;
    let (low, high) = (after(low), after(high));
    low.min(end)..high.min(end)
}
