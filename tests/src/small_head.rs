//! A small simulated head: its camera sees the projector's pixels one by one, as the default one does, on a small part of its picture.

/// Its scenario, to which tests add timing, light and faults.
pub const SMALL_HEAD: &str = "sub_rays = 2
part = { kind = \"plane\" }
[rig.camera]
width = 128
height = 96
fov_deg = [5.0, 3.75]
";
