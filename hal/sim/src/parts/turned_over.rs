//! A thin surface that lies upside down: turned over about x, in the middle plane of its box.

use super::Surface;
use crate::optics::Vector;

/// A surface seen from below.
pub(super) struct TurnedOver {
    surface: Box<dyn Surface>,
    /// z of its lowest point and of its highest together.
    ends: f64,
}

impl TurnedOver {
    pub fn new(surface: Box<dyn Surface>) -> Self {
        let [low, high] = surface.bounds();
        Self {
            surface,
            ends: low[2] + high[2],
        }
    }
}

impl Surface for TurnedOver {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.ends - self.surface.height(x, -y)
    }

    fn present(&self, x: f64, y: f64) -> bool {
        self.surface.present(x, -y)
    }

    fn albedo(&self, x: f64, y: f64) -> f64 {
        self.surface.albedo(x, -y)
    }

    fn slope_bound(&self) -> f64 {
        self.surface.slope_bound()
    }

    fn bounds(&self) -> [Vector; 2] {
        let [low, high] = self.surface.bounds();
        [[low[0], -high[1], low[2]], [high[0], -low[1], high[2]]]
    }
}
