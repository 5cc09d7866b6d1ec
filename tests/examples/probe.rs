use hal::frame::Samples;
use tests::oracle::{self, demodulate::demodulate};
fn main() {
    let (_, rec) = tests::shared::recording("slstudio-board2").unwrap();
    let m = appliance::measure::measure(&rec, std::path::Path::new("x")).unwrap();
    for at in 0..2 {
        let t = oracle::decode(&rec, at);
        let mut map = std::collections::BTreeMap::new();
        let mut tie = 0;
        for p in 0..t.reason.len() {
            let a = m.phases[at].trust[p].word();
            let b = t.reason[p].word();
            if a != b && !(a == "out_of_range") {
                *map.entry((a, b)).or_insert(0) += 1;
                for l in oracle::levels_of(&rec, at) {
                    let s: Vec<f64> = l
                        .frames
                        .iter()
                        .map(|&f| match rec.frames[f].frame.samples() {
                            Samples::Eight(x) => x[p] as f64,
                            _ => 0.,
                        })
                        .collect();
                    let d = demodulate(&s, &l.shifts);
                    if (d.modulation - 16.0).abs() < 1e-9 {
                        tie += 1;
                        if tie < 4 {
                            println!("{:?} {:?} {}", s, l.shifts, d.modulation);
                        }
                    }
                }
            }
        }
        println!("{at} {map:?} ties {tie}");
    }
}
