//! A small simulated head: its camera has fewer pixels and a smaller field of view than the default one, with the same resolution on the part.

/// Its scenario, to which tests add timing, lighting and faults.
pub const SMALL_HEAD: &str = "sub_rays = 2
part = { kind = \"plane\" }
[rig.camera]
width = 128
height = 96
fov_deg = [5.0, 3.75]
";
