//! Which of several collectors a head belongs to: rendezvous hashing (Thaler and Ravishankar,
//! 1998). Where a collector is added or taken away, only the heads that it gets or had move.

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use std::str::FromStr;

/// Collector `number` of `count`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    number: u32,
    count: u32,
}

/// The most collectors.
const MOST: u32 = 1000;

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
        match numbers {
            Some((number, count)) if (1..=count).contains(&number) && count <= MOST => {
                Ok(Self { number, count })
            }
            _ => Err(format!(
                "write the second of three as 2/3, at most of {MOST}"
            )),
        }
    }
}

impl Part {
    /// Whether it is this collector's to ask the head with this serial, or this address while the
    /// serial is not known. Weights are numbers of a generator with the FNV-1a hash of the key as seed.
    pub fn has(self, key: &str) -> bool {
        let hash = key.bytes().fold(0xCBF2_9CE4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        });
        let mut weights = SplitMix64::seed_from_u64(hash);
        let best = (1..=self.count).max_by_key(|_| weights.next_u64());
        best == Some(self.number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn owner(key: &str, count: u32) -> u32 {
        let owners: Vec<_> = (1..=count)
            .filter(|&number| Part { number, count }.has(key))
            .collect();
        assert_eq!(owners.len(), 1, "{key} has {owners:?}");
        owners[0]
    }

    #[test]
    fn each_head_has_one_collector_and_moves_only_to_one_that_is_new() {
        let serials: Vec<_> = (0..3000).map(|n| format!("SN-{n:05}")).collect();
        let mut moved = 0;
        for serial in &serials {
            let (before, after) = (owner(serial, 3), owner(serial, 4));
            assert!(before == after || after == 4);
            moved += u32::from(before != after);
        }
        assert!(
            (600..900).contains(&moved),
            "{moved} of 3000 moved to a fourth"
        );
        let share = |n| {
            serials
                .iter()
                .filter(|serial| owner(serial, 3) == n)
                .count()
        };
        assert!((1..=3).all(|n| (850..1150).contains(&share(n))));
    }

    #[test]
    fn a_part_is_written_as_a_fraction() {
        assert_eq!(
            "2/3".parse(),
            Ok(Part {
                number: 2,
                count: 3
            })
        );
        for wrong in ["0/3", "4/3", "1", "1/0", "1/1001", "a/b"] {
            assert!(wrong.parse::<Part>().is_err(), "{wrong}");
        }
    }
}
