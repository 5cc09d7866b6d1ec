//! From which sample on a camera is not linear: where it clips, or where it begins to compress bright light.
//!
//! **Idea.** Four exposures at a time show four times the light of one. Where they show less, the camera clips or
//! bends. Ramps of all greys show both over all samples, whatever is in front of the head, and neither
//! the projector's response nor other light matters: both are in both pictures.
//!
//! **Equation.** With the samples s₁ and s₄ of the ramps and d₁ and d₄ of black, by one exposure and by four,
//!
//! ```text
//! q = (s₄ − d₄) / (s₁ − d₁)          the mean of q over the pixels of a bin of s₄, over that of all dark bins
//! ```
//!
//! falls below 1 from where the camera clips or bends. A camera that clips has its largest sample more often
//! than any other.

use super::{SETTLE, take};
use hal::error::Error;
use hal::head::Head;
use hal::projector::Raster;

/// Columns of a ramp of all greys; others follow: a camera may see a small part of the projector.
const RAMP: u32 = 64;
/// Exposures of the brighter pictures: as many as any recipe has.
const LONG: u32 = 4;
/// Samples are told apart in so many bins over full scale.
const BINS: usize = 64;
/// Bins of the dark half, in which every camera is linear.
const DARK: usize = BINS / 2;
/// Pixels of a bin whose mean tells something.
const FEWEST: usize = 16;
/// A pixel tells something if one exposure shows this share of full scale.
const LEAST: f64 = 1.0 / 64.0;
/// A mean of q below this is bent.
const BENT: f64 = 0.985;
/// The largest sample is a plateau if it occurs so many times as often as the samples of the bin before it.
const PLATEAU: f64 = 4.0;

/// Where a camera clips.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Clips {
    /// All samples below full scale are linear.
    AtFullScale,
    /// This sample and larger ones are not.
    From(u16),
    /// It was not seen, and why.
    Unknown(&'static str),
}

/// Finds where the camera clips.
///
/// # Errors
/// The error of a device.
pub fn clipping(head: &mut Head) -> Result<Clips, Error> {
    let (columns, rows) = head.projector_size();
    let grey = |at: u32| (at % columns % RAMP * 255 / (RAMP - 1)) as u8;
    let ramp = Raster::new(columns, rows, (0..columns * rows).map(grey).collect())?;
    let patterns = vec![Raster::uniform(columns, rows, 0)?, ramp];
    let mut taken = Vec::with_capacity(4);
    for exposures in [1, LONG] {
        let pictures = take(head, (SETTLE, exposures), patterns.clone(), &mut |counts| {
            taken.push(counts);
        });
        match pictures {
            Err(Error::Unsupported { .. }) => {
                return Ok(Clips::Unknown("this head cannot expose for longer"));
            }
            pictures => pictures?,
        }
    }
    let full_scale = head.camera_format().full_scale();
    let [dark, once, dark_long, long] = &taken[..] else {
        return Ok(Clips::Unknown("its pictures did not come"));
    };
    let pairs = once.iter().zip(dark).zip(long.iter().zip(dark_long));
    let pairs = pairs.map(|((once, dark), (long, dark_long))| {
        let [once, long_light] = [once - dark, long - dark_long].map(f64::from);
        (f64::from(*long), long_light, once)
    });
    Ok(found(pairs, full_scale))
}

/// Pixels of a bin, and the light of long exposures and of one in them.
type Bin = (usize, f64, f64);

/// Where samples are not linear, by the sample and the light of long exposures and the light of one.
fn found(pairs: impl Iterator<Item = (f64, f64, f64)>, full_scale: u16) -> Clips {
    let most = f64::from(full_scale);
    let width = (most + 1.0) / BINS as f64;
    let bin_of = |sample: f64| ((sample / width) as usize).min(BINS - 1);
    let mut bins: Vec<Bin> = vec![(0, 0.0, 0.0); BINS];
    let (mut largest, mut often) = (0.0_f64, 0_usize);
    for (sample, long, once) in pairs.filter(|(.., once)| *once > LEAST * most) {
        let (count, of_long, of_once) = &mut bins[bin_of(sample)];
        (*count, *of_long, *of_once) = (*count + 1, *of_long + long, *of_once + once);
        if sample > largest {
            (largest, often) = (sample, 0);
        }
        often += usize::from(sample == largest);
    }
    let all = |bins: &[Bin]| {
        let [long, once] =
            [|bin: &Bin| bin.1, |bin: &Bin| bin.2].map(|of| bins.iter().map(of).sum::<f64>());
        long / once
    };
    let linear = all(&bins[..DARK]);
    let is_known = |bin: &usize| bins[*bin].0 >= FEWEST;
    if !linear.is_finite() || (DARK..BINS).filter(is_known).count() < DARK / 8 {
        return Clips::Unknown("too little light comes back: put a bright part into view");
    }
    let last = bin_of(largest);
    let beside = last.checked_sub(1).map_or(0, |bin| bins[bin].0);
    let is_plateau = often as f64 * width > PLATEAU * beside as f64;
    // Noise and the few greys of a ramp bend a bin, but not all from there on.
    let is_straight = |bin: &usize| all(&bins[*bin..=*bin]) >= BENT * linear;
    let straight = (DARK..BINS).filter(is_known).rfind(is_straight);
    let bent = (straight.unwrap_or(DARK) + 1..BINS).find(is_known);
    match bent {
        Some(bin) if bin < last || !is_plateau => {
            // It begins to bend in the bin before.
            Clips::From((width * (bin - 1) as f64) as u16)
        }
        _ if is_plateau && largest < most => Clips::From(largest as u16),
        _ if largest < most => {
            Clips::Unknown("the brightest sample is below full scale: expose for longer")
        }
        _ => Clips::AtFullScale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a camera of 8 bits with this response finds, of light up to so much of full scale by four exposures.
    fn of(response: impl Fn(f64) -> f64, brightest: f64) -> Clips {
        let mut state = 11_u64;
        let mut noise = move || {
            // Knuth's generator of 1997.
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31) * 3.0 - 1.5
        };
        let other = 10.0;
        let pairs = (0..60_000).map(|at| {
            let light = f64::from(at) / 60_000.0 * brightest * 255.0;
            let mut seen = |light: f64| response(light + noise()).round().clamp(0.0, 255.0);
            let (once, long) = (seen(other + light / 4.0), seen(4.0 * other + light));
            (long, long - 4.0 * other, once - other)
        });
        found(pairs, 255)
    }

    #[test]
    fn clipping_and_a_knee_are_found_to_a_fortieth_of_full_scale() {
        assert_eq!(of(|light| light, 2.0), Clips::AtFullScale);
        for clip in [235.0, 200.0, 150.0] {
            assert_eq!(of(|light| light.min(clip), 2.0), Clips::From(clip as u16));
        }
        for knee in [204.0, 180.0, 150.0] {
            let bent = |light: f64| light - (light - knee).max(0.0) * 0.75;
            let Clips::From(found) = of(bent, 2.0) else {
                panic!("{knee}");
            };
            assert!(
                (f64::from(found) - knee).abs() <= 6.0,
                "{found}, not {knee}"
            );
        }
    }

    #[test]
    fn what_was_not_reached_is_not_known() {
        assert!(matches!(of(|light| light, 0.7), Clips::Unknown(_)));
        assert!(matches!(of(|light| light, 0.1), Clips::Unknown(_)));
        assert!(matches!(of(|light| 0.0 * light, 2.0), Clips::Unknown(_)));
    }
}
