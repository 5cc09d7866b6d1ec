//! A shaded view of a measured surface: neighbouring points as small facets, seen obliquely.

use algo::geometry::Vector;
use algo::phase::Trust;
use appliance::head::calibrated::Measured;
use appliance::output::canvas::Canvas;

/// Elevation of the view above the plane z = 0, after a turn about z, radians.
const ELEVATION: f64 = 0.96;
const TURN: f64 = 0.35;
/// Facets whose corners differ more in z span a depth edge and are not drawn, mm.
const DEPTH_EDGE_MM: f64 = 10.0;
/// Direction to the lamp (x, y, z), low enough that noise is visible.
const LAMP: Vector = Vector::new(-0.70, -0.30, 0.65);
/// Grey of a facet that faces away from the lamp, and what is added to it if it faces the lamp.
const DARK: f64 = 50.0;
const BRIGHT: f64 = 200.0;
/// Share of the points at each end of an axis that may lie outside of the picture.
const TAIL: f64 = 0.002;

/// The picture, `size` pixels wide and high.
pub fn render(measured: &Measured, size: usize) -> Canvas<1> {
    let width = measured.heights.width;
    let points = points(measured);
    let mut canvas = Canvas::new(size, size);
    let mut nearest = vec![f64::NEG_INFINITY; size * size];
    let Some(viewport) = Viewport::around(&points, size) else {
        return canvas;
    };
    for at in 0..points.len().saturating_sub(width + 1) {
        if at % width + 1 == width {
            continue;
        }
        for corners in [
            [at, at + 1, at + width],
            [at + 1, at + width + 1, at + width],
        ] {
            let [Some(a), Some(b), Some(c)] = corners.map(|corner| points[corner]) else {
                continue;
            };
            let low = a.z.min(b.z).min(c.z);
            if a.z.max(b.z).max(c.z) - low <= DEPTH_EDGE_MM {
                let seen = [a, b, c].map(|point| viewport.seen(point));
                facet(&mut canvas, &mut nearest, seen, grey(a, b, c));
            }
        }
    }
    canvas
}

/// The resolved points of each camera pixel, mm.
fn points(measured: &Measured) -> Vec<Option<Vector>> {
    let heights = &measured.heights;
    let pixels = heights.height.iter().zip(&measured.phases.trust);
    pixels
        .enumerate()
        .map(|(at, (height, trust))| {
            let (u, v) = (at % heights.width, at / heights.width);
            let resolved = *trust == Trust::Resolved;
            resolved.then(|| measured.triangulator.point(u, v, *height))?
        })
        .collect()
}

/// Lambert's law on the facet's normal.
fn grey(a: Vector, b: Vector, c: Vector) -> u8 {
    let normal = (b - a).cross(c - a);
    // The camera is above: the side that it sees looks up.
    let length = normal.length() * if normal.z < 0.0 { -1.0 } else { 1.0 };
    let facing = normal.dot(LAMP) / (length * LAMP.length());
    // A facet without an area has no normal; a NaN becomes 0.
    (DARK + BRIGHT * facing.max(0.0)) as u8
}

/// Projects points into the picture: x and y in pixels, and how near the point is.
struct Viewport {
    scale: f64,
    centre: [f64; 2],
    half: f64,
}

impl Viewport {
    fn around(points: &[Option<Vector>], size: usize) -> Option<Self> {
        let seen: Vec<_> = points
            .iter()
            .flatten()
            .map(|point| turned(*point))
            .collect();
        let ends = |axis: usize| {
            let mut values: Vec<f64> = seen.iter().map(|point| point[axis]).collect();
            values.sort_by(f64::total_cmp);
            let last = values.len().checked_sub(1)?;
            let tail = (last as f64 * TAIL) as usize;
            Some([values[tail], values[last - tail]])
        };
        let ([left, right], [low, high]) = (ends(0)?, ends(1)?);
        let extent = (right - left).max(high - low).max(1e-3);
        Some(Self {
            scale: 0.96 * size as f64 / extent,
            centre: [(left + right) / 2.0, (low + high) / 2.0],
            half: size as f64 / 2.0,
        })
    }

    fn seen(&self, point: Vector) -> [f64; 3] {
        let [x, y, near] = turned(point);
        [
            self.half + self.scale * (x - self.centre[0]),
            self.half - self.scale * (y - self.centre[1]),
            near,
        ]
    }
}

/// A world point in the coordinates of the view: right, up, towards the eye.
fn turned(Vector { x, y, z }: Vector) -> [f64; 3] {
    let (sin, cos) = TURN.sin_cos();
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    let (sin, cos) = ELEVATION.sin_cos();
    [x, y * sin + z * cos, z * sin - y * cos]
}

/// Fills a facet where nothing nearer is.
fn facet(canvas: &mut Canvas<1>, nearest: &mut [f64], corners: [[f64; 3]; 3], grey: u8) {
    let [a, b, c] = corners;
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 {
        return;
    }
    let size = canvas.width as f64 - 1.0;
    let range = |axis: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]).ceil().max(0.0);
        let high = a[axis].max(b[axis]).max(c[axis]).floor().min(size);
        // A facet wholly outside has an empty range.
        (low as usize)..((high + 1.0).max(0.0) as usize)
    };
    for y in range(1) {
        for x in range(0) {
            let (px, py) = (x as f64, y as f64);
            let share = |p: [f64; 3], q: [f64; 3]| {
                ((q[0] - p[0]) * (py - p[1]) - (q[1] - p[1]) * (px - p[0])) / area
            };
            let (of_c, of_a, of_b) = (share(a, b), share(b, c), share(c, a));
            if of_a < 0.0 || of_b < 0.0 || of_c < 0.0 {
                continue;
            }
            let near = of_a * a[2] + of_b * b[2] + of_c * c[2];
            let at = y * canvas.width + x;
            if near > nearest[at] {
                nearest[at] = near;
                canvas.set(x, y, [grey]);
            }
        }
    }
}
