//! What speaks against the pixels of a block.

use crate::phase::arrived::NO_DOUBT;
use crate::phase::unwrap::too_far;
use crate::simd::Lanes;
use crate::trust::Trust;

/// Doubts about the pixels of a block.
#[derive(Clone, Copy)]
pub(crate) struct Doubts<V: Lanes> {
    /// Mask: every level is strong.
    pub strong: V::B,
    /// 255 where a sample is at full scale.
    pub brightest: V::B,
    /// The most that a step left over.
    pub left: [V::W; 2],
}

impl<V: Lanes> Doubts<V> {
    /// The number of the first [`Trust`] that speaks against each pixel, or [`NO_DOUBT`]. Whether a pixel is dark is not asked.
    #[inline(always)]
    pub fn first(&self, v: V) -> V::B {
        let residual = v.splat8(Trust::Residual as u8);
        let first = v.pick8(self.doubtful(v), residual, v.splat8(NO_DOUBT));
        let first = v.pick8(self.saturated(v), v.splat8(Trust::Saturated as u8), first);
        v.pick8(self.strong, first, v.splat8(Trust::LowModulation as u8))
    }

    /// Whether nothing speaks against any pixel of the block, nor has `before`: the first doubts of levels below.
    #[inline(always)]
    pub fn none(&self, v: V, before: V::B) -> bool {
        let against = v.or8(self.doubtful(v), self.saturated(v));
        v.all8(v.pick8(against, v.splat8(0), v.min8(self.strong, before)))
    }

    #[inline(always)]
    fn doubtful(&self, v: V) -> V::B {
        v.narrow_mask([too_far(v, self.left[0]), too_far(v, self.left[1])])
    }

    #[inline(always)]
    fn saturated(&self, v: V) -> V::B {
        v.eq8(self.brightest, v.splat8(u8::MAX))
    }
}

/// The first doubts where all that is known is which pixels are lit.
#[inline(always)]
pub(crate) fn unless_dark<V: Lanes>(v: V, lit: V::B) -> V::B {
    v.max8(lit, v.splat8(Trust::Dark as u8))
}

/// Masks of words: nothing speaks against the pixel.
#[inline(always)]
pub(crate) fn none<V: Lanes>(v: V, first: V::B) -> [V::W; 2] {
    let none = v.eq8(first, v.splat8(NO_DOUBT));
    v.widen(none, none)
}

/// The first doubts as numbers of [`Trust`].
#[inline(always)]
pub(crate) fn trust<V: Lanes>(v: V, first: V::B) -> V::B {
    // `NO_DOUBT` becomes 0, which is `Resolved`; every other number stays.
    v.xor8(first, v.eq8(first, v.splat8(NO_DOUBT)))
}
