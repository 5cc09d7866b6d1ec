//! Fringes whose shifts, response or brightest samples are not what they seem.

use super::scene::{HEIGHT, PROJECTOR, Scene, WIDTH, check_phase, lit_by, notes};
use std::f64::consts::TAU;
use std::fs;
use tests::files;

#[test]
fn levels_that_start_dark_are_named_with_their_first_shift() {
    let mut scene = Scene::new();
    for fringes in [1.0, 6.0, 36.0] {
        scene.level(fringes, 4, |k| k + 0.5);
    }
    let levels = ["--fringes", "1,6,36", "--json"];
    for convention in ["sin", "cos"] {
        let options = [&levels[..], &["--convention", convention]].concat();
        let words = notes(&scene.import(&options).succeeded());
        fs::remove_dir_all(scene.path("recording")).unwrap();
        let named = "give --convention cos --shift + --first-shift 0.5";
        assert!(
            words.len() == 1 && words[0].contains(named),
            "{convention}: {words:?}"
        );
    }
    let right = ["--convention", "cos", "--first-shift", "0.5"];
    let run = scene.import(&[&levels[..], &right].concat()).succeeded();
    assert_eq!(notes(&run), [""; 0]);
    let out = scene.measure();
    let pitch = f64::from(PROJECTOR.0) / 36.0;
    let count = check_phase(&out.join("phase.npy"), pitch, |u, v| lit_by(u, v).0, 0.4);
    assert!(count > WIDTH * HEIGHT * 99 / 100, "{count}");
}

#[test]
fn a_response_that_is_not_linear_is_named_and_not_the_order_of_the_pictures() {
    let mut scene = Scene::new();
    for fringes in [1.0, 8.0, 64.0] {
        for k in 0..3 {
            scene.show(|xi, _| {
                let turns = fringes * xi / f64::from(PROJECTOR.0) + f64::from(k) / 3.0;
                (0.5 + 0.5 * (TAU * turns).sin()).powf(2.2)
            });
        }
    }
    let options = ["--fringes", "1,8,64", "--steps", "3", "--json"];
    let words = notes(&scene.import(&options).succeeded());
    assert!(
        words.len() == 1 && words[0].contains("response"),
        "{words:?}"
    );
    assert!(
        words[0].contains("3 times per fringe") && !words[0].contains("order"),
        "{words:?}"
    );
}

/// A projector of gamma 2: 4 shifts and more cancel its second harmonic in the phase.
#[test]
fn harmonics_of_the_response_are_no_noise_and_are_named_with_their_size() {
    for steps in [4, 12] {
        let mut scene = Scene::new();
        for fringes in [1.0, 8.0, 64.0] {
            for k in 0..steps {
                scene.show(|xi, _| {
                    let turns = fringes * xi / f64::from(PROJECTOR.0) + k as f64 / steps as f64;
                    (0.5 + 0.5 * (TAU * turns).sin()).powi(2)
                });
            }
        }
        let count = steps.to_string();
        let options = ["--fringes", "1,8,64", "--steps", &count, "--json"];
        let words = notes(&scene.import(&options).succeeded());
        // An amplitude of 190/8 counts of the second harmonic, and noise, of a modulation of 95.
        let named = ["off a sine by 16.", "off a sine by 17."];
        let is_named = named.iter().any(|size| words[0].contains(size));
        assert!(words.len() == 1 && is_named, "{words:?}");
        let report = files::report(&scene.measure());
        // ± 2 counts, and rounding to whole ones.
        let expected = (4.0_f64 / 3.0 + 1.0 / 12.0).sqrt();
        let found = report["noise_counts"].as_f64().unwrap();
        assert!(
            (0.9..1.15).contains(&(found / expected)),
            "{steps}: {found}"
        );
    }
}

/// Pictures of 1 and 8 fringes, 4 shifts, whose middle reflects more than the camera can see, in
/// samples of 16 or 8 bits; the first column of the middle and the first one behind it.
fn overexposed(wide: bool) -> (Scene, [usize; 2]) {
    let scene = Scene::new();
    let mut random = tests::random::Random::new(9);
    let mut at = 0;
    for fringes in [1.0, 8.0] {
        for k in 0..4 {
            let mut samples = Vec::new();
            for v in 0..HEIGHT {
                for u in 0..WIDTH {
                    let turns = fringes * lit_by(u, v).0 / 400.0 + f64::from(k) / 4.0;
                    let bright = if (60..70).contains(&u) { 1.7 } else { 0.9 };
                    let light = bright * (0.5 + 0.4 * (TAU * turns).sin());
                    let light = light + 0.01 * (random.share() - 0.5);
                    match wide {
                        true => {
                            let sample = ((light * 4095.0).round() as u16).min(4095) << 4;
                            samples.extend(sample.to_be_bytes());
                        }
                        false => samples.push((16.0 + light * 219.0).round().min(235.0) as u8),
                    }
                }
            }
            let file = fs::File::create(scene.path(&format!("pictures/pat{at}.png"))).unwrap();
            at += 1;
            let mut encoder = png::Encoder::new(file, WIDTH as u32, HEIGHT as u32);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.set_depth(match wide {
                true => png::BitDepth::Sixteen,
                false => png::BitDepth::Eight,
            });
            let mut writer = encoder.write_header().unwrap();
            writer.write_image_data(&samples).unwrap();
        }
    }
    (scene, [60, 70])
}

#[test]
fn samples_that_are_clipped_below_full_scale_have_no_phase_and_are_named() {
    for (wide, words) in [
        (true, "at full scale"),
        (false, "clipped at 235 of 255 counts"),
    ] {
        let (scene, [first, behind]) = overexposed(wide);
        let run = scene.import(&["--fringes", "1,8", "--json"]).succeeded();
        let said = notes(&run);
        assert!(said.iter().any(|note| note.contains(words)), "{said:?}");
        let out = scene.measure();
        let report = files::report(&out);
        let saturated = report["unresolved"]["saturated"].as_u64().unwrap();
        assert!(saturated > 500, "{report}");
        let count = check_phase(&out.join("phase.npy"), 50.0, |u, v| lit_by(u, v).0, 0.3);
        assert!(
            count > (WIDTH - (behind - first)) * HEIGHT * 99 / 100,
            "{count}"
        );
    }
}
