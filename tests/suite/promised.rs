//! What teaching says of good parts that lie elsewhere than taught, against such parts: matte, and of
//! materials over which light moves.

use super::every_part::{Line, TOLERANCE_MM, stock};
use super::placement::{bed, taught_within};
use sim::{Material, Scenario};
use tests::random::Random;

#[test]
fn a_few_good_parts_keep_what_teaching_says_also_where_light_moves_over_them() {
    good_parts_keep_what_teaching_says(&["handset"], &[Some(Material::Oiled)], 4, 2);
}

#[test]
#[ignore = "takes an hour: `.ci/run full`"]
fn two_hundred_good_parts_of_every_material_keep_what_teaching_says() {
    let kinds = ["sheet_metal", "tube", "plate", "face"];
    good_parts_keep_what_teaching_says(&kinds, &MATERIALS, 200, 4);
}

/// Over whose rounded edges lines of light move.
#[test]
#[ignore = "takes minutes: `.ci/run full`"]
fn two_hundred_handsets_of_every_material_keep_what_teaching_says() {
    good_parts_keep_what_teaching_says(&["handset"], &MATERIALS, 200, 4);
}

const MATERIALS: [Option<Material>; 3] = [
    Some(Material::Matte),
    Some(Material::RolledSteel),
    Some(Material::Oiled),
];

/// What teaching says of displaced parts is at most this many times the largest deviation of many.
const MOST_OF_LARGEST: f64 = 2.0;

/// No part deviates by more than teaching said, but for U, and what it said is not far from the
/// largest of many. Pixels have so many rays a side.
fn good_parts_keep_what_teaching_says(
    kinds: &[&str],
    materials: &[Option<Material>],
    placements: usize,
    sub_rays: u32,
) {
    let mut wrong = Vec::new();
    for (kind, part) in stock()
        .into_iter()
        .filter(|(kind, _)| kinds.contains(&&**kind))
    {
        for &material in materials {
            let mut bed = bed(&Scenario {
                part: part.clone(),
                sub_rays,
                material,
                ..Scenario::default()
            });
            let taught = taught_within(&mut bed, TOLERANCE_MM).unwrap();
            let good = taught.manifest.good_parts.unwrap();
            let said = good.displaced_mm + 3.0 * good.displaced_scatter_mm;
            let limit_mm = taught.manifest.gauges[0].high.unwrap();
            let mut line = Line::of(bed, taught.recipe, limit_mm, part.clone());
            let (mut random, mut largest, mut beyond) = (Random::new(17), 0.0_f64, 0);
            for _ in 0..placements {
                let placement = line.placement(&mut random);
                let found = line.judge(&placement);
                let gauge = &found.gauges[0];
                let (value, u) = (gauge.value.unwrap().abs(), gauge.uncertainty.unwrap());
                largest = largest.max(value);
                beyond += u32::from(value > said + u);
            }
            println!(
                "{kind} {material:?}: said {said:.3} mm, largest of {placements} {largest:.3} mm, {beyond} beyond"
            );
            let loose = placements >= 100 && said > MOST_OF_LARGEST * largest;
            if beyond > 0 || loose {
                wrong.push((kind.clone(), material, said, largest, beyond));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
