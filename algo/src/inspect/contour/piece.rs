//! A contour in pieces of about two pixels, each with the pixels across it.

use super::beyond::{Wall, background, shadow};
use super::sample::Samples;
use super::shape::{Foot, Shape};
use super::view::{Setup, View};
use alloc::vec::Vec;
use core::ops::Range;

/// Length of a piece, px.
const LENGTH: f64 = 2.0;
/// How far from the contour pixels are looked at, px.
pub const BAND: f64 = 5.0;

/// A pixel of a piece.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    /// Which of the samples.
    pub sample: usize,
    /// Signed distance from the contour, px.
    pub d: f64,
    /// By how much larger that of the background's border is, px.
    pub behind: f64,
    /// By how much that border moves when the contour moves by 1 along d.
    pub follow: f64,
}

/// A piece of a contour.
#[derive(Clone, Debug)]
pub struct Piece {
    /// Its middle.
    pub foot: Foot,
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
    /// Number and piece of each sample, a buffer.
    order: Vec<(usize, usize)>,
}

/// mm per px in the picture at a place of the plane: the lengths of the sides of a pixel.
pub fn pixel_size(view: &impl View, (x, y): (f64, f64)) -> Option<f64> {
    let [a, b] = frame(view, view.pixel(x, y)?)?.map(|(x, y, _)| (x, y));
    Some(libm::sqrt(libm::fabs(a.0 * b.1 - a.1 * b.0)))
}

/// How x, y and the plane's phase change with u and with v.
fn frame(view: &impl View, (u, v): (f64, f64)) -> Option<[(f64, f64, f64); 2]> {
    let change = |du: f64, dv: f64| {
        let (less, more) = (view.spot(u - du, v - dv)?, view.spot(u + du, v + dv)?);
        Some((more.x - less.x, more.y - less.y, more.phase - less.phase))
    };
    Some([change(0.5, 0.0)?, change(0.0, 0.5)?])
}

impl Pieces {
    /// Divides a contour into pieces. What the camera does not see of it has pieces without pixels.
    pub fn divide<const N: usize>(
        &mut self,
        (shape, p): (&impl Shape<N>, &[f64; N]),
        view: &impl View,
        (setup, thickness): (&Setup, f64),
        samples: &Samples,
        (pixel, band): (f64, f64),
    ) {
        let length = shape.length(p);
        // Casts keep to the range of their type; a contour has fewer pieces than samples.
        let count = (length / (LENGTH * pixel) + 0.5) as usize;
        let count = count.clamp(1, samples.all.len().max(1));
        self.order.clear();
        for (at, sample) in samples.all.iter().enumerate() {
            if libm::fabs(shape.distance(p, sample.x, sample.y)) > (band + 2.0) * pixel {
                continue;
            }
            if let Some(along) = shape.along(p, sample.x, sample.y) {
                let piece = (along / length * count as f64) as usize;
                self.order.push((piece.min(count - 1), at));
            }
        }
        self.order.sort_unstable();
        self.all.clear();
        self.pixels.clear();
        let mut next = 0;
        for number in 0..count {
            let foot = shape.foot(p, length * (number as f64 + 0.5) / count as f64);
            let here = next;
            while self.order.get(next).is_some_and(|of| of.0 == number) {
                next += 1;
            }
            let start = self.pixels.len();
            let mut piece = Piece {
                foot,
                scale: pixel,
                normal: (1.0, 0.0),
                gradient: 0.0,
                wall: None,
                shadow: 0.0,
                pixels: start..start,
            };
            if piece.orient(view, setup, thickness).is_some() {
                for &(_, at) in &self.order[here..next] {
                    let seen = Pixel::of((shape, p), (setup, thickness), samples, (at, &piece));
                    if libm::fabs(seen.d) <= band {
                        self.pixels.push(seen);
                    }
                }
                piece.pixels.end = self.pixels.len();
            }
            self.all.push(piece);
        }
    }
}

impl Piece {
    /// Works out how it lies in the picture; `None` if it is not seen.
    fn orient(&mut self, view: &impl View, setup: &Setup, thickness: f64) -> Option<()> {
        let Foot { x, y, normal, .. } = self.foot;
        let [along_u, along_v] = frame(view, view.pixel(x, y)?)?;
        let d = |(x, y, _): (f64, f64, f64)| normal.0 * x + normal.1 * y;
        let rate = (d(along_u), d(along_v));
        let square = rate.0 * rate.0 + rate.1 * rate.1;
        if !(square > 0.0) {
            return None;
        }
        self.scale = libm::sqrt(square);
        self.normal = (rate.0 / self.scale, rate.1 / self.scale);
        self.gradient = self.normal.0 * along_u.2 + self.normal.1 * along_v.2;
        self.shadow = shadow(setup, (x, y), normal) / self.scale;
        self.wall = Wall::at(setup, thickness, (x, y), normal);
        if let Some(wall) = &mut self.wall {
            wall.width /= self.scale;
        }
        Some(())
    }
}

impl Pixel {
    fn of<const N: usize>(
        (shape, p): (&impl Shape<N>, &[f64; N]),
        (setup, thickness): (&Setup, f64),
        samples: &Samples,
        (sample, piece): (usize, &Piece),
    ) -> Self {
        let (x, y) = (samples.all[sample].x, samples.all[sample].y);
        let d = shape.distance(p, x, y);
        let (farther, at) = background((shape, p), setup, thickness, (x, y));
        let mut follow = 1.0;
        if farther > d {
            // The step is along the contour's normal, so this is the cosine between both borders.
            let step = 0.1 * piece.scale;
            let (x, y) = piece.foot.normal;
            let ahead = shape.distance(p, at.0 + step * x, at.1 + step * y);
            follow = ((ahead - farther) / step).clamp(0.0, 1.0);
        }
        Self {
            sample,
            d: d / piece.scale,
            behind: (farther - d) / piece.scale,
            follow,
        }
    }
}
