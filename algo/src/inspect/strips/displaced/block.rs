//! A block of pixels with the motion taken back: heights, displacements, and deviations from golden's corners.

use crate::inspect::strips::pose::Node;
use crate::math::nearest::{nearest, whole};
use crate::pipeline::NO_OFFSET;
use crate::units::Height;

/// Pixels that are worked on together; the distance of two nodes is a multiple of it.
pub(super) const BLOCK: usize = 32;
/// Larger displacements, pixels, are taken as not known.
const MAX_AWAY: f32 = 4096.0;

/// A block of pixels with the motion taken back. Masks are 0 or −1.
pub(super) struct Block {
    /// Mask: height and displacement are known.
    pub known: [i32; BLOCK],
    /// Height, nm.
    z: [i32; BLOCK],
    /// dz, nm.
    gain: [f32; BLOCK],
    /// du.
    pub along: Displacements,
    /// dv.
    pub down: Displacements,
}

/// Displacements of a block along one axis, pixels.
pub(super) struct Displacements {
    /// Rounded to nearest.
    pub nearest: [i32; BLOCK],
    /// Rounded down.
    pub whole: [i32; BLOCK],
    /// What rounding down takes off.
    share: [f32; BLOCK],
}

impl Displacements {
    const NONE: Self = Self {
        nearest: [0; BLOCK],
        whole: [0; BLOCK],
        share: [0.0; BLOCK],
    };

    /// Splits displacements, which are in `share` before, into whole pixels and what is left.
    #[inline(always)]
    fn split(&mut self) {
        for i in 0..BLOCK {
            let pixels = self.share[i];
            let nearest = nearest(pixels);
            let below = if nearest > pixels {
                nearest - 1.0
            } else {
                nearest
            };
            self.nearest[i] = whole(nearest);
            self.whole[i] = whole(below);
            self.share[i] = pixels - below;
        }
    }

    /// The least and the largest whole displacement of the known pixels.
    #[inline(always)]
    pub fn range(&self, known: &[i32; BLOCK]) -> (i32, i32) {
        let (mut least, mut most) = (i32::MAX, i32::MIN);
        for (&whole, &known) in self.whole.iter().zip(known) {
            let low = (whole & known) | (i32::MAX & !known);
            let high = (whole & known) | (i32::MIN & !known);
            least = if low < least { low } else { least };
            most = if high > most { high } else { most };
        }
        (least, most)
    }
}

impl Block {
    pub const EMPTY: Self = Self {
        known: [0; BLOCK],
        z: [0; BLOCK],
        gain: [0.0; BLOCK],
        along: Displacements::NONE,
        down: Displacements::NONE,
    };

    /// Takes the motion back in a block between two nodes; `offset` is the column of its first pixel from the first node,
    /// `unit` a pixel as a share of the way between them.
    #[inline(always)]
    pub fn take_back(
        &mut self,
        (from, to): (Node, Node),
        (offset, unit): (i32, f32),
        middle: f32,
        (bases, offsets): (&[Height], &[i32]),
    ) {
        let length = offsets.len();
        let bases = &bases[..length];
        let (known, z, gain) = (
            &mut self.known[..length],
            &mut self.z[..length],
            &mut self.gain[..length],
        );
        let (along, down) = (
            &mut self.along.share[..length],
            &mut self.down.share[..length],
        );
        for i in 0..length {
            let base = if bases[i].is_known() {
                bases[i].nm()
            } else {
                0
            };
            z[i] = base.wrapping_add(offsets[i]);
            let share = offset.wrapping_add(i as i32) as f32 * unit;
            let above = z[i] as f32 * 1e-6 - middle;
            let du = at(&from, &to, 0, share, above);
            let dv = at(&from, &to, 1, share, above);
            let near = (offsets[i] != NO_OFFSET) & is_near(du) & is_near(dv);
            known[i] = -i32::from(near);
            along[i] = if near { du } else { 0.0 };
            down[i] = if near { dv } else { 0.0 };
            gain[i] = at(&from, &to, 2, share, above) * 1e6;
        }
        for known in &mut self.known[length..] {
            *known = 0;
        }
        self.along.split();
        self.down.split();
    }

    /// How far pixel `i` lies above golden, nm; the corners are left and right, above and below.
    #[inline(always)]
    pub fn deviation(&self, i: usize, corners: [i32; 4]) -> f32 {
        let [first, right, under, both] = corners;
        let right = right.wrapping_sub(first) as f32;
        let under = under.wrapping_sub(first) as f32;
        let both = both.wrapping_sub(first) as f32;
        let (along, down) = (self.along.share[i], self.down.share[i]);
        let golden = along * right + down * (under + along * (both - under - right));
        let above = self.z[i].wrapping_sub(first) as f32;
        (above + self.gain[i]) - golden
    }
}

/// A value of the nodes around a pixel.
#[inline(always)]
fn at(from: &Node, to: &Node, value: usize, share: f32, above: f32) -> f32 {
    mix(from.value[value], to.value[value], share)
        + mix(from.slope[value], to.slope[value], share) * above
}

#[inline(always)]
fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}

/// Whether a displacement is known; NaN is not.
#[inline(always)]
fn is_near(pixels: f32) -> bool {
    (pixels > -MAX_AWAY) & (pixels < MAX_AWAY)
}
