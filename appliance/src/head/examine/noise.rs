//! The camera's noise, from two pictures of each of several grey levels.

use super::pictures::{Lit, greys, pictures};
use algo::frame::{CameraNoise, PhotonTransfer};
use hal::error::Error;
use hal::head::Head;

/// Grey levels of which two pictures are taken.
const GREYS: [u8; 8] = [16, 48, 80, 112, 144, 176, 208, 240];

/// The camera's noise from two pictures of each of eight greys, with its σ at half the light of
/// white.
///
/// # Errors
/// The error of a device, or `Unsupported` if no level is clear of black and full scale.
pub fn noise(head: &mut Head, settle: u32, lit: &Lit) -> Result<CameraNoise, Error> {
    let levels = GREYS.iter().flat_map(|grey| [*grey, *grey]);
    let full_scale = lit.full_scale();
    let mut sums = PhotonTransfer::new(full_scale);
    let mut before: Option<Vec<f32>> = None;
    pictures(
        head,
        settle,
        greys(head.projector_size(), levels),
        &mut |counts| match before.take() {
            None => before = Some(counts),
            Some(first) => {
                let share = lit.share_of_white((lit.mean(&first) + lit.mean(&counts)) / 2.0);
                sums.add(&first, &counts, lit.levels(share));
            }
        },
    )?;
    sums.noise(lit.bright() / 2.0).ok_or_else(|| {
        Error::unsupported(
            "measuring noise where every level is dark or saturated",
            "expose so that white is at half to nine tenths of full scale",
        )
    })
}
