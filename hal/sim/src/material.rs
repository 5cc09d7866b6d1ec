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

    /// Matte squares that are printed on a part, in rows along its own x and y; one lies about its origin.
    #[derive(Copy)]
    pub struct Print: Default {
        /// Share of the projector's light that they reflect, as `diffuse` of the light.
        pub diffuse: f64 = 0.0..=1.0 => 0.8,
        /// Their side, mm.
        pub side_mm: f64 = 0.1..=1000.0 => 10.0,
        /// From one to the next, mm.
        pub pitch_mm: f64 = 0.1..=1000.0 => 40.0,
    }
}

impl Print {
    /// Whether it covers this point of the part.
    fn covers(&self, [x, y, _]: Vector) -> bool {
        let within = |along: f64| {
            let pitches = (along + self.side_mm / 2.0) / self.pitch_mm;
            pitches.rem_euclid(1.0) * self.pitch_mm < self.side_mm
        };
        within(x) && within(y)
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
    /// Black plastic with a weak sheen.
    BlackPlastic,
}

impl Material {
    /// Every material with its name.
    pub const ALL: [(Self, &str); 4] = [
        (Self::Matte, "matte"),
        (Self::RolledSteel, "rolled_steel"),
        (Self::Oiled, "oiled"),
        (Self::BlackPlastic, "black_plastic"),
    ];

    /// The lighting of a part of this material: only the ambient light is that of `light`.
    #[must_use]
    pub fn under(self, light: &Lighting) -> Lighting {
        let [diffuse, specular, shininess] = match self {
            Self::Matte => [0.86, 0.0, 1.0],
            Self::RolledSteel => [0.35, 0.8, 30.0],
            Self::Oiled => [0.25, 2.0, 80.0],
            Self::BlackPlastic => [0.08, 0.15, 20.0],
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
    /// diffuse + specular, or the print where that is brighter.
    pub brightest: f64,
    /// Of the part itself, and of what is printed on it.
    bare: Lighting,
    printed: Option<(Print, Lighting)>,
}

impl Reflection {
    /// The reflection that a light and a print ask for.
    pub fn new(light: &Lighting, print: Option<Print>) -> Self {
        let brightest = light.diffuse + light.specular;
        let brightest = print.map_or(brightest, |print| brightest.max(print.diffuse));
        // A black part has weights, which are multiplied by 0.
        let [diffuse, specular] = match brightest > 0.0 {
            true => [light.diffuse / brightest, light.specular / brightest],
            false => [1.0, 0.0],
        };
        let ink = |print: Print| Lighting {
            diffuse: print.diffuse / brightest,
            specular: 0.0,
            ..*light
        };
        Self {
            brightest,
            bare: Lighting {
                diffuse,
                specular,
                ..*light
            },
            printed: print.map(|print| (print, ink(print))),
        }
    }

    /// Of what is printed at a point of the part, if anything is.
    pub fn printed(&self, point: Vector) -> Option<&Lighting> {
        let (print, light) = self.printed.as_ref()?;
        print.covers(point).then_some(light)
    }

    /// At a point of the part, or of what is around it, which has no print.
    pub fn at(&self, point: Vector, of_part: bool) -> &Lighting {
        let printed = self.printed(point).filter(|_| of_part);
        printed.unwrap_or(&self.bare)
    }
}

impl Lighting {
    /// The share of the light from `towards` that goes to `eye`; none if it comes from behind.
    pub(super) fn share(&self, normal: Vector, towards: Vector, eye: Vector) -> Option<f64> {
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
