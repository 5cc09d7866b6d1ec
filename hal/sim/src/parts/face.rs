//! A face: the subject of the paper's Fig. 18, in a design of this project.
//!
//! 136 mm wide, 192 mm high and 75 mm deep, in front of z = 0 by half of that: forehead, brows,
//! eyes in their sockets, nose, cheeks, lips and chin on an oval, each a smooth swell (`relief`).
//! Its steepest places are the flanks of the nose.

use serde::{Deserialize, Serialize};

use super::Defect;
use super::relief::{Relief, Swell};

/// The face and its dents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Face {
    /// Dents; a good part has none.
    pub defects: Vec<Defect>,
}

/// z of the oval's foot, and how far its material reaches, mm.
const BASE: f64 = -37.0;
const RIM: f64 = 68.0;

impl Face {
    /// The surface of a good face.
    pub(super) fn surface() -> Relief {
        let one = [
            // The oval, first: its outline.
            Swell::along([[0.0, -26.0], [0.0, 28.0]], [0.0, 84.0], 46.0),
            // Forehead.
            Swell::along([[-14.0, 60.0], [14.0, 60.0]], [0.0, 50.0], 6.0),
            // Nose: its root, bridge and tip.
            Swell::along([[0.0, 40.0], [0.0, -8.0]], [0.0, 24.0], 8.0),
            Swell::along([[0.0, 14.0], [0.0, -15.0]], [0.0, 19.0], 8.5),
            Swell::round([0.0, -15.5], [0.0, 17.0], 7.5),
            // Mouth: its swelling, the lips, and the line between them.
            Swell::along([[-9.0, -47.0], [9.0, -47.0]], [0.0, 32.0], 6.0),
            Swell::along([[-12.0, -43.0], [0.0, -41.0]], [0.0, 9.0], 2.0),
            Swell::along([[12.0, -43.0], [0.0, -41.0]], [0.0, 9.0], 2.0),
            Swell::along([[-9.0, -52.0], [9.0, -52.0]], [0.0, 10.5], 4.2),
            Swell::along([[-18.0, -46.0], [18.0, -46.0]], [0.0, 5.5], -2.2),
            // Philtrum, the hollow below the lips, and the chin.
            Swell::along([[0.0, -28.0], [0.0, -36.0]], [0.0, 6.5], -1.2),
            Swell::along([[-8.0, -62.0], [8.0, -62.0]], [0.0, 13.0], -3.2),
            Swell::along([[-6.0, -77.0], [6.0, -77.0]], [0.0, 27.0], 11.0),
        ];
        let right = [
            // Brow, eye socket and eye.
            Swell::along([[10.0, 34.0], [38.0, 33.0]], [0.0, 19.0], 5.5),
            Swell::along([[21.0, 17.0], [33.0, 16.0]], [0.0, 21.0], -10.0),
            Swell::along([[24.0, 16.0], [31.0, 15.5]], [0.0, 13.0], 6.0),
            // The fold of the lid, the wing of the nose, and the cheekbone.
            Swell::along([[17.0, 22.0], [36.0, 21.5]], [0.0, 6.0], -1.2),
            Swell::along([[8.0, -17.0], [9.5, -19.0]], [0.0, 12.0], 5.5),
            Swell::along([[36.0, -4.0], [46.0, 4.0]], [0.0, 38.0], 8.0),
            // The hollow of the cheek, the fold from the nose to the mouth, and the corner of the
            // mouth.
            Swell::along([[48.0, -38.0], [40.0, -56.0]], [0.0, 34.0], -4.5),
            Swell::along([[17.0, -22.0], [27.0, -42.0]], [0.0, 11.0], -2.2),
            Swell::round([21.0, -46.0], [0.0, 10.0], -1.8),
        ];
        let left: Vec<Swell> = right.iter().map(Swell::mirrored).collect();
        let swells = one.into_iter().chain(right).chain(left);
        Relief::new(swells.collect(), BASE, RIM)
    }
}
