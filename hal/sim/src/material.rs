//! What a part is made of, and how much of a projector's light it reflects towards the camera
//! (B. T. Phong, 1975).

use serde::{Deserialize, Serialize};

use super::optics::{Vector, dot};
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

/// How a part reflects, in shares of the brightest that it can be, so that no weight is larger than
/// that of a pixel that arrives completely.
pub(super) struct Reflection {
    /// diffuse + specular.
    pub brightest: f64,
    diffuse: f64,
    specular: f64,
    shininess: f64,
}

impl Reflection {
    /// The reflection that a light asks for.
    pub fn new(light: &Lighting) -> Self {
        let brightest = light.diffuse + light.specular;
        // A black part has weights, which are multiplied by 0.
        let [diffuse, specular] = match brightest > 0.0 {
            true => [light.diffuse / brightest, light.specular / brightest],
            false => [1.0, 0.0],
        };
        Self {
            brightest,
            diffuse,
            specular,
            shininess: light.shininess,
        }
    }

    /// The share of the light from `towards` that goes to `eye`; none if it comes from behind.
    pub fn share(&self, normal: Vector, towards: Vector, eye: Vector) -> Option<f64> {
        let cosine = facing(normal, towards)?;
        let mut share = self.diffuse * cosine;
        if self.specular > 0.0 {
            // r·v with r = 2 (n·l) n − l.
            let mirrored = 2.0 * cosine * dot(normal, eye) - dot(towards, eye);
            share += self.specular * mirrored.max(0.0).powf(self.shininess);
        }
        Some(share)
    }
}

/// The cosine between normal and direction to the light: the share of the light that the surface
/// receives; none from behind.
fn facing(normal: Vector, towards: Vector) -> Option<f64> {
    let cosine = dot(normal, towards);
    (cosine > 0.0).then_some(cosine)
}
