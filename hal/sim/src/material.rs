//! What a part is made of: how it reflects the projector's light.

use serde::{Deserialize, Serialize};

use super::scenario::Lighting;

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
