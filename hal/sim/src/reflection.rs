//! How much of a projector's light a part reflects towards the camera (B. T. Phong, 1975).

use super::material::Lighting;
use super::optics::{Vector, dot};
use super::trace::facing;

/// How a part reflects: shares of the brightest that it can be, so that no weight is larger than
/// that of a pixel that arrives completely.
pub(super) struct Reflection {
    /// diffuse + specular.
    pub brightest: f64,
    diffuse: f64,
    specular: f64,
    shininess: f64,
}

impl Reflection {
    /// Of this light.
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
