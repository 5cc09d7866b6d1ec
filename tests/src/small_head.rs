//! Small simulated heads: their cameras have fewer pixels and a smaller field of view than the
//! default one, with the same resolution on the part.

/// The scenario of a head of `width` × `height` camera pixels, and twice as many projector pixels
/// each way, in front of a plane.
pub fn tiny_head(width: u32, height: u32) -> String {
    format!(
        "sub_rays = 1
part = {{ kind = \"plane\" }}
[rig.camera]
width = {width}
height = {height}
fov_deg = [5.0, 3.75]
[rig.projector]
width = {}
height = {}
fov_deg = [8.0, 6.0]
",
        2 * width,
        2 * height
    )
}

/// The scenario of a small head, to which tests add timing, lighting and faults.
pub const SMALL_HEAD: &str = "sub_rays = 2
part = { kind = \"plane\" }
[rig.camera]
width = 128
height = 96
fov_deg = [5.0, 3.75]
";
