//! Prints hashes of the kernels' results, and decodes single cases for counting instructions, on
//! any machine.
//!
//! ```text
//! cargo run -p algo --example probe                 one line per back-end and case: hashes of the maps
//! cargo run -p algo --example probe decode CASE R W decodes the first R rows of one case, W pixels wide
//!                                                   (default 1456), once, and prints the number of
//!                                                   pixels
//! ```
//!
//! CASE is the name of a case, one of `cases.rs` or another of that form; with `/background`
//! appended three quarters of the frames are dark, with `/aligned` every frame begins at a page of
//! 16 KiB, as a camera's buffers do, with `/quiet` a quiet head's modulations are trusted. At the
//! end may stand a back-end, as in `single-4-8@ssse3`; without it the fastest is used.
//!
//! The hashes must be those of `frozen.txt` on every machine and with every back-end; a test here
//! checks it. After a change that is meant to change bits, `probe | sed 's/[^ ]* //' | awk
//! '!seen[$0]++'` writes that file anew.

mod cases;
mod hash;
mod rig;
mod scene;

use algo::phase::{Decoder, LeastModulation};
use algo::pipeline::{decode, triangulate};
use algo::simd::Backend;
use cases::Case;
use hash::Hash;
use scene::{Image, Lighting};
use std::env;
use std::error::Error;
use std::hint::black_box;
use std::io::{Write, stdout};
use std::process::ExitCode;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// A size that is a multiple of no block, and one that is smaller than every block.
const SIZES: [(usize, usize); 2] = [(67, 48), (13, 9)];
/// Size of the frames for counting: as wide as the camera's.
const COUNTED: (usize, usize) = (1456, 48);

/// The least modulation that a quiet head trusts, counts of 8 bits.
const QUIET_COUNTS: f64 = 5.0;

/// The decoder with each back-end of this machine.
fn backends(decoder: &Decoder) -> Vec<(&'static str, Decoder)> {
    Backend::available()
        .map(|backend| (backend.name(), decoder.clone().with_backend(backend)))
        .collect()
}

/// The back-end of that name.
fn backend(name: &str) -> Outcome<Backend> {
    let found = Backend::available().find(|backend| backend.name() == name);
    found.ok_or_else(|| format!("{name} is not a back-end of this machine").into())
}

/// The case's name and the hashes of phase, modulation, trust and height.
fn line(case: &Case, decoder: &Decoder) -> Outcome<String> {
    let [mut phase, mut modulation, mut trust, mut height] = [Hash::default(); 4];
    for (columns, rows) in SIZES {
        let image = Image::new(case, Lighting::Everything, columns, rows);
        let mut map = decode(decoder, &image.frames(rows)?, image.map(case), None)?;
        for at in 0..columns * rows {
            phase.add(&map.phase[at].to_bits().to_le_bytes());
            modulation.add(&map.modulation[at].to_bits().to_le_bytes());
            trust.add(&[map.trust[at] as u8]);
        }
        let rig = rig::triangulator(columns, rows)?;
        for z in triangulate(&rig, decoder, None, &mut map, &|_| ()).height {
            height.add(&z.nm().to_le_bytes());
        }
    }
    let name = &case.name;
    Ok(format!("{name} {phase} {modulation} {trust} {height}"))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Outcome<()> {
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => {
            for case in cases::all() {
                let case = case?;
                for (name, decoder) in backends(&case.decoder()?) {
                    writeln!(stdout(), "{name} {}", line(&case, &decoder)?)?;
                }
            }
            Ok(())
        }
        ["decode", counted, rows, ref rest @ ..] if rest.len() <= 1 => {
            let (case, backend) = match counted.split_once('@') {
                Some((case, name)) => (case, Some(backend(name)?)),
                None => (counted, None),
            };
            let (name, way) = case.split_once('/').unwrap_or((case, ""));
            let light = match way {
                "background" => Lighting::Background,
                _ => Lighting::Even,
            };
            let case = Case::named(name)?;
            let (widest, height) = COUNTED;
            let width = match rest.first() {
                Some(width) => width.parse::<usize>()?.min(widest),
                None => widest,
            };
            let image = Image::new(&case, light, width, height);
            let image = match way {
                "aligned" => image.aligned(),
                _ => image,
            };
            let frames = image.frames(rows.parse::<usize>()?.min(height))?;
            let decoder = case.decoder()?;
            let decoder = match backend {
                Some(backend) => decoder.with_backend(backend),
                None => decoder,
            };
            let decoder = match (way, LeastModulation::new(QUIET_COUNTS)) {
                ("quiet", Some(least)) => decoder.with_least_modulation(least),
                _ => decoder,
            };
            let map = decode(&decoder, &frames, image.map(&case), None)?;
            Ok(writeln!(stdout(), "{}", black_box(map).phase.len())?)
        }
        _ => Err("usage: probe [decode CASE ROWS [WIDTH]]".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::CASES;
    use algo::phase::Trust;

    #[test]
    fn every_back_end_on_every_machine_gives_the_frozen_bits() {
        let frozen: Vec<&str> = include_str!("frozen.txt").lines().collect();
        for case in cases::all().map(Result::unwrap) {
            for (name, decoder) in backends(&case.decoder().unwrap()) {
                let line = line(&case, &decoder).unwrap();
                assert!(frozen.contains(&line.as_str()), "{name} gives\n{line}");
            }
        }
        assert_eq!(frozen.len(), CASES.len());
    }

    #[test]
    fn the_frames_show_every_reason_and_most_of_the_surface() {
        for case in cases::all().map(Result::unwrap) {
            let (width, height) = SIZES[0];
            let image = Image::new(&case, Lighting::Everything, width, height);
            let decoder = case.decoder().unwrap();
            let frames = image.frames(height).unwrap();
            let mut map = decode(&decoder, &frames, image.map(&case), None).unwrap();
            let rig = rig::triangulator(width, height).unwrap();
            triangulate(&rig, &decoder, None, &mut map, &|_| ());
            for reason in Trust::REASONS {
                // A single level is the coarsest and has no unwrapping step, so no residual; only
                // maps have unknown pixels; a phase within a few turns of the map is within the
                // working range.
                let expected = match reason {
                    Trust::LowModulation => case.levels.len() > 1,
                    Trust::Unexpected => case.needs_map(),
                    Trust::Residual => case.levels.len() > 1,
                    Trust::OutOfRange => !case.needs_map() || case.levels.len() > 2,
                    // Refused where a recipe says so.
                    Trust::LightEdge => false,
                    _ => true,
                };
                assert_eq!(map.count(reason) > 0, expected, "{}: {reason:?}", case.name);
            }
            let resolved = map.count(Trust::Resolved);
            assert!(3 * resolved > width * height, "{}: {resolved}", case.name);
        }
    }

    #[test]
    fn what_is_counted_is_resolved_everywhere() {
        for case in cases::all().map(Result::unwrap) {
            let (width, height) = (COUNTED.0, 4);
            let image = Image::new(&case, Lighting::Even, width, height);
            let frames = image.frames(height).unwrap();
            let map = decode(&case.decoder().unwrap(), &frames, image.map(&case), None).unwrap();
            assert_eq!(map.count(Trust::Resolved), width * height, "{}", case.name);
        }
    }
}
