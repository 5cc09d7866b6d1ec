//! What frames show, as recipes store it: [ratio, shift in turns], and for a waveform that is not a
//! sine [ratio, shift, [[order, share of the fundamental], …]].

use algo::pattern::{Shot, Waveform};
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

pub(super) fn serialize<S: Serializer>(shots: &[Shot], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(shots.iter().map(|shot| Entry(*shot)))
}

pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<Shot>, D::Error> {
    let entries: Vec<Entry> = Vec::deserialize(from)?;
    Ok(entries.into_iter().map(|entry| entry.0).collect())
}

struct Entry(Shot);

impl Serialize for Entry {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Shot {
            ratio,
            shift,
            waveform,
        } = self.0;
        let harmonics: Vec<_> = waveform.harmonics().collect();
        match harmonics.is_empty() {
            true => [ratio, shift].serialize(to),
            false => (ratio, shift, harmonics).serialize(to),
        }
    }
}

impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Numbers;
        impl<'de> Visitor<'de> for Numbers {
            type Value = Entry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("[ratio, shift], or [ratio, shift, [[order, share], ...]]")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Entry, A::Error> {
                let mut number = |at| {
                    let element = list.next_element::<f64>()?;
                    element.ok_or_else(|| A::Error::invalid_length(at, &self))
                };
                let (ratio, shift) = (number(0)?, number(1)?);
                let harmonics: Vec<(u8, f64)> = list.next_element()?.unwrap_or_default();
                let waveform = Waveform::of(&harmonics);
                // An order that cannot be stored, or one that is there twice.
                if waveform.harmonics().count() != harmonics.len() {
                    return Err(A::Error::custom(format!(
                        "harmonics {harmonics:?}: write each order from 2 to {} once, with its share",
                        algo::pattern::MAX_ORDER
                    )));
                }
                Ok(Entry(Shot {
                    ratio,
                    shift,
                    waveform,
                }))
            }
        }
        from.deserialize_seq(Numbers)
    }
}
