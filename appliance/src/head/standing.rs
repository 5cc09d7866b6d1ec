//! Which pose of the board is z = 0, and whether it can be, in words.

use algo::calibration::Standing;
use algo::geometry::{Pinhole, Vector};

/// The pose that z = 0 goes by.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Its name.
    pub pose: String,
    /// How the board stands in it.
    pub standing: Standing,
}

impl Ground {
    /// The pose with this name, whose board is z = 0 of these models.
    pub fn of(pose: &str, camera: &Pinhole, projector: &Pinhole) -> Self {
        let up = Vector::new(0.0, 0.0, 1.0);
        Self {
            pose: pose.to_owned(),
            standing: Standing::new(up, camera.centre(), projector.centre()),
        }
    }

    /// Where z = 0 is.
    pub fn words(&self) -> String {
        let Standing {
            camera, projector, ..
        } = self.standing;
        format!(
            "z = 0 is the board as it lies in {}, tilted by {:.0}° to the camera and by {:.0}° to the projector",
            self.pose,
            camera.to_degrees(),
            projector.to_degrees()
        )
    }

    /// What to do if the board can hardly have lain flat under the head.
    pub fn remedy(&self) -> Option<String> {
        let aside = self.standing.aside.to_degrees();
        self.standing.is_doubtful().then(|| {
            format!(
                "in {} the board is tilted ({aside:.0}° aside of camera and projector): unless the parts lie like this, lay it flat where they lie, and take that as the last pose",
                self.pose
            )
        })
    }
}
