//! Planes fitted to points.

/// z = a x + b y + c.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    a: f64,
    b: f64,
    c: f64,
}

impl Plane {
    /// The least-squares plane in z; none for fewer than 3 points or collinear points.
    pub fn fit(points: &[[f64; 3]]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let count = points.len() as f64;
        let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / count;
        let centre = [mean(0), mean(1), mean(2)];
        let moment = |i: usize, j: usize| {
            points
                .iter()
                .map(|p| (p[i] - centre[i]) * (p[j] - centre[j]))
                .sum::<f64>()
        };
        let (xx, xy, yy) = (moment(0, 0), moment(0, 1), moment(1, 1));
        let (xz, yz) = (moment(0, 2), moment(1, 2));
        let determinant = xx * yy - xy * xy;
        if !(determinant > 1e-9 * (xx * yy)) {
            return None;
        }
        let a = (xz * yy - yz * xy) / determinant;
        let b = (yz * xx - xz * xy) / determinant;
        let c = centre[2] - a * centre[0] - b * centre[1];
        Some(Self { a, b, c })
    }

    /// z at (x, y).
    pub fn at(&self, x: f64, y: f64) -> f64 {
        self.a * x + self.b * y + self.c
    }

    /// Distance of a point from the plane, signed, in the points' unit.
    pub fn distance(&self, point: [f64; 3]) -> f64 {
        (point[2] - self.at(point[0], point[1])) / (1.0 + self.a * self.a + self.b * self.b).sqrt()
    }
}
