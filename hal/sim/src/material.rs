//! What a part is made of: how it reflects the projector's light.

use serde::{Deserialize, Serialize};

use hal::bounded;

bounded! {
    /// Phong's model: I = ambient + pattern/255 · (diffuse · max(0, n·l) + specular · max(0,
    /// r·v)^shininess), 1 = full scale. n is the surface's normal, l the direction to the
    /// projector, v that to the camera, and r is l mirrored about n.
    #[derive(Copy)]
    pub struct Lighting: Default {
        /// Light that does not come from the projector.
        pub ambient: f64 = 0.0..=100.0 => 0.04,
        /// Share of the projector's light that a surface reflects which faces the projector.
        pub diffuse: f64 = 0.0..=100.0 => 0.86,
        /// Share of the projector's light that a surface reflects which mirrors the projector into
        /// the camera, 0…4.
        pub specular: f64 = 0.0..=4.0,
        /// How narrow the highlight is: the exponent of its cosine, 1…500.
        pub shininess: f64 = 1.0..=500.0 => 1.0,
    }
}

/// A material by name, instead of the `diffuse`, `specular` and `shininess` of a scenario's
/// `[light]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Material {
    /// Light in all directions alike.
    Matte,
    /// Bare sheet metal: a broad highlight.
    RolledSteel,
    /// Metal under oil: a narrow highlight beyond full scale.
    Oiled,
}

impl Material {
    /// Every material with its name.
    pub const ALL: [(Self, &str); 3] = [
        (Self::Matte, "matte"),
        (Self::RolledSteel, "rolled_steel"),
        (Self::Oiled, "oiled"),
    ];

    /// The lighting of a part of this material: only the ambient light is that of `light`.
    #[must_use]
    pub fn under(self, light: &Lighting) -> Lighting {
        let [diffuse, specular, shininess] = match self {
            Self::Matte => [0.86, 0.0, 1.0],
            Self::RolledSteel => [0.35, 0.8, 30.0],
            Self::Oiled => [0.25, 2.0, 80.0],
        };
        Lighting {
            ambient: light.ambient,
            diffuse,
            specular,
            shininess,
        }
    }
}
