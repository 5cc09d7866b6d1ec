//! The base of a telephone's handset: the subject of the paper's Fig. 19, in a design of this
//! project.
//!
//! 84 mm wide, 196 mm long along y and 30 mm deep, about z = 0: a rounded shell with an ear piece
//! and a mouth piece, the cradle's hollow between them, a ridge along the grip, and flat panels,
//! each a plateau with smooth flanks (`relief`).

use serde::{Deserialize, Serialize};

use super::Defect;
use super::relief::{Relief, Swell};

/// The handset and its dents.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Handset {
    /// Dents; a good part has none.
    pub defects: Vec<Defect>,
}

/// z of the shell's foot, and how far its material reaches, mm.
const BASE: f64 = -16.0;
const RIM: f64 = 42.0;

impl Handset {
    /// The surface of a good handset.
    pub(super) fn surface() -> Relief {
        let swells = vec![
            // The shell, first: its outline.
            Swell::along([[0.0, -56.0], [0.0, 56.0]], [24.0, 46.0], 17.0),
            // The cradle's hollow across the grip.
            Swell::along([[-60.0, 0.0], [60.0, 0.0]], [12.0, 40.0], -7.0),
            // Ear piece: a raised disc with a dish.
            Swell::round([0.0, 60.0], [22.0, 31.0], 7.0),
            Swell::round([0.0, 60.0], [4.0, 19.0], -4.5),
            // Mouth piece: a lower disc, with a flat panel in it and a boss on that.
            Swell::round([0.0, -60.0], [20.0, 30.0], 5.5),
            Swell::round([0.0, -60.0], [13.0, 17.0], -2.0),
            Swell::round([0.0, -60.0], [3.0, 8.0], 2.5),
            // A ridge along the grip, and a flat panel on either side of it.
            Swell::along([[0.0, -22.0], [0.0, 22.0]], [1.0, 7.0], 3.0),
            Swell::along([[17.0, -14.0], [17.0, 14.0]], [6.0, 8.0], -1.2),
            Swell::along([[-17.0, -14.0], [-17.0, 14.0]], [6.0, 8.0], -1.2),
        ];
        Relief::new(swells, BASE, RIM)
    }
}
