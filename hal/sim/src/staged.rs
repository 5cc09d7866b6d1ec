//! A placed part with its light transport.

use std::sync::Arc;

use super::ground::Ground;
use super::material::Material;
use super::parts::Part;
use super::placement::Placement;
use super::scenario::Scenario;
use super::transport::Transport;

/// A placed part with its light transport, ready to be put in place.
#[derive(Clone, Debug)]
pub struct Staged {
    pub(super) part: Part,
    pub(super) material: Option<Material>,
    pub(super) placement: Placement,
    pub(super) floor: Option<Ground>,
    pub(super) transport: Arc<Transport>,
}

impl Staged {
    pub(super) fn new(
        scenario: &Scenario,
        part: &Part,
        material: Option<Material>,
        placement: &Placement,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Self {
        let transport = Transport::build(scenario, part, material, placement, progress);
        Self {
            part: part.clone(),
            material,
            placement: *placement,
            floor: scenario.floor.clone(),
            transport: Arc::new(transport),
        }
    }
}
