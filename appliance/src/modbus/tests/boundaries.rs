//! Boundary values in every write: each is answered as the map says, and what is refused changes
//! nothing.

use super::*;
use crate::modbus::map;
use crate::station::control::BUFFERED;
use crate::tests::one_in;

/// Ends of a register and of its halves.
const WORDS: [u16; 5] = [0, 1, 0x7FFF, 0x8000, 0xFFFF];
/// Ends of a pair of registers.
const PAIRS: [u32; 5] = [0, 1, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF];
/// Registers of CONTROL and coils.
const CONTROL: u32 = 32;
const COILS: u32 = 16;

/// One connection, and what it has written.
struct Writer {
    plant: Plant,
    stream: TcpStream,
    cases: usize,
    written: usize,
}

/// A range of registers or coils that is written: the exception for its count, then the one for its
/// place.
fn place(first: u16, count: usize, most: usize, end: u32) -> Option<u8> {
    match () {
        () if count == 0 || count > most => Some(3),
        () if u32::from(first) + count as u32 > end => Some(2),
        () => None,
    }
}

/// The exception for what is written to CONTROL.
fn values(first: u16, words: &[u16]) -> Option<u8> {
    let refused = (first..).zip(words).any(|(address, &word)| match address {
        at::control::CONTROL => word & 0xFE00 != 0,
        at::control::RECIPE_SELECT => (10_000..0xFFFF).contains(&word),
        24.. => word != 0,
        _ => false,
    });
    refused.then_some(3)
}

fn bytes(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

impl Writer {
    async fn new() -> Self {
        let plant = Plant::new().await;
        let stream = TcpStream::connect(plant.address).await.unwrap();
        Self {
            plant,
            stream,
            cases: 0,
            written: 0,
        }
    }

    async fn block(&mut self, first: u16, count: u8) -> Vec<u16> {
        let [high, low] = first.to_be_bytes();
        let answer = raw(&mut self.stream, &[3, high, low, 0, count]).await;
        let words = answer[2..].chunks_exact(2);
        words
            .map(|word| u16::from_be_bytes([word[0], word[1]]))
            .collect()
    }

    /// Sends a write that shall be refused with an exception, or carried out: then CONTROL is
    /// `wanted` of what it was.
    async fn write(&mut self, request: &[u8], refused: Option<u8>, wanted: impl Fn(&mut [u16])) {
        let before = self.plant.handle.snapshot();
        let mut control = self.block(0, 32).await;
        let answer = raw(&mut self.stream, request).await;
        let case = format!("{:02X?}", &request[..request.len().min(12)]);
        self.cases += 1;
        if let Some(exception) = refused {
            assert_eq!(answer, [request[0] | 0x80, exception], "{case}");
            // Nothing was published since.
            assert!(
                Arc::ptr_eq(&before, &self.plant.handle.snapshot()),
                "{case}"
            );
            return;
        }
        assert_eq!(answer[0], request[0], "{case}: {answer:02X?}");
        self.written += 1;
        wanted(&mut control);
        let mut found = self.block(0, 32).await;
        // The mode stays until bit 8 ends it, whatever is written.
        for block in [&mut found, &mut control] {
            block[0] &= !BUFFERED;
        }
        assert_eq!(found, control, "{case}");
        let identity = before.identity.clone();
        assert_eq!(self.plant.handle.snapshot().identity, identity, "{case}");
        self.plant.work();
    }

    /// FC6, FC16 and FC23 of these words.
    async fn words(&mut self, first: u16, words: &[u16]) {
        let (count, [high, low]) = (words.len(), first.to_be_bytes());
        let content = bytes(words);
        let quantity = u16::try_from(count).unwrap().to_be_bytes();
        let length = [quantity[0], quantity[1], content.len() as u8];
        let refused = |most| place(first, count, most, CONTROL).or_else(|| values(first, words));
        let set = |control: &mut [u16]| {
            control[usize::from(first)..][..count].copy_from_slice(words);
        };
        if let [word] = words {
            let [one, two] = word.to_be_bytes();
            self.write(&[6, high, low, one, two], refused(1), set).await;
        }
        let mut request = vec![16, high, low];
        request.extend(length.iter().chain(&content));
        self.write(&request, refused(123), set).await;
        let mut request = vec![23, 0, 100, 0, 1, high, low];
        request.extend(length.iter().chain(&content));
        // A frame holds no more.
        request.truncate(253);
        self.write(&request, refused(121), set).await;
    }
}

#[tokio::test]
async fn a_boundary_value_in_a_write_of_a_register_is_refused_as_the_map_says_or_stored() {
    let mut writer = Writer::new().await;
    let blocks = map::BLOCKS.map(|(block, ..)| block);
    for address in blocks
        .iter()
        .flat_map(|block| block.first..=block.last + 1)
        .chain([99, u16::MAX])
    {
        // Other values at each address.
        let first = usize::from(address) % one_in();
        for word in WORDS.into_iter().skip(first).step_by(one_in()) {
            writer.words(address, &[word]).await;
        }
        for pair in PAIRS.into_iter().skip(first).step_by(one_in()) {
            let pair = [(pair >> 16) as u16, pair as u16];
            writer.words(address, &pair).await;
        }
    }
    // PART_NUMBER, and writes across the ends of ranges.
    for first in [
        0,
        1,
        4,
        8,
        23,
        24,
        31,
        32,
        99,
        100,
        131,
        199,
        200,
        319,
        900,
        u16::MAX,
    ] {
        for count in [3, 8, 16, 17, 24, 31, 32, 33, 120, 121, 122, 123] {
            for word in WORDS {
                writer.words(first, &vec![word; count]).await;
            }
        }
        // Counts with more registers than a frame can hold.
        for count in [0, 124, 0x7FFF, 0x8000, 0xFFFFu16] {
            let ([high, low], [most, least]) = (first.to_be_bytes(), count.to_be_bytes());
            let bytes = (2 * u32::from(count)) as u8;
            let mut request = vec![16, high, low, most, least, bytes];
            request.extend(vec![0; usize::from(bytes).min(247)]);
            writer.write(&request, Some(3), |_| ()).await;
        }
    }
    let Writer { cases, written, .. } = writer;
    println!("{cases} boundary values in registers, {written} of them were stored");
    match one_in() {
        1 => assert_eq!((cases, written), (81_775, 743)),
        _ => assert!(cases > 20_000 && written > 100),
    }
}

#[tokio::test]
async fn a_boundary_value_in_a_write_of_a_coil_is_refused_as_the_map_says_or_stored() {
    let mut writer = Writer::new().await;
    for first in (0..=17).chain([0x7FFF, 0x8000, u16::MAX]) {
        let [high, low] = first.to_be_bytes();
        for word in [0, 1, 0x7FFF, 0x8000, 0xFF00, 0xFFFFu16] {
            let [one, two] = word.to_be_bytes();
            let set = word == 0xFF00;
            let refused = [0, 0xFF00]
                .contains(&word)
                .then(|| place(first, 1, 1, COILS));
            let refused = refused.unwrap_or(Some(3));
            let refused = refused.or((set && first >= 9).then_some(3));
            let request = [5, high, low, one, two];
            writer
                .write(&request, refused, |control| {
                    control[0] = control[0] & !(1 << first) | u16::from(set) << first;
                })
                .await;
        }
        for count in [0, 1, 2, 8, 9, 15, 16, 17, 1968, 1969, 0xFFFFu16] {
            for byte in [0, 0xFF] {
                let [most, least] = count.to_be_bytes();
                let content = usize::from(count).div_ceil(8);
                let mut request = vec![15, high, low, most, least, content as u8];
                request.extend(vec![byte; content.min(247)]);
                let refused = place(first, count.into(), 1968, COILS);
                let reserved = byte != 0 && u32::from(first) + u32::from(count) > 9;
                let refused = refused.or(reserved.then_some(3));
                writer
                    .write(&request, refused, |control| {
                        let mask = (((1u32 << count) - 1) << first) as u16;
                        control[0] = control[0] & !mask | if byte == 0 { 0 } else { mask };
                    })
                    .await;
            }
        }
    }
    let Writer { cases, written, .. } = writer;
    println!("{cases} boundary values in coils, {written} of them were stored");
    assert_eq!((cases, written), (588, 96));
}
