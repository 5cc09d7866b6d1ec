//! From the words of a request to one write of the PLC.

use super::map::at::control as a;
use crate::config::WordOrder;
use crate::station::{ControlWrite, Masked};

/// First of the reserved registers at the end of CONTROL.
const RESERVED: u16 = a::PART_NUMBER + 16;

/// The write of `words` to the registers from `first` on, or `None` if a reserved register is
/// not 0.
///
/// The caller has checked that they lie in CONTROL. Half of a 32-bit item changes that half only.
pub fn control_write(first: u16, words: &[u16], order: WordOrder) -> Option<ControlWrite> {
    let mut write = ControlWrite::default();
    for (address, &word) in (first..).zip(words) {
        match address {
            a::CONTROL => write.control = Masked::<u16>::all(word),
            a::TRIGGER_TOKEN => write.token = Some(word),
            a::RECIPE_SELECT => write.recipe_select = Some(word),
            a::PLC_HEARTBEAT => write.plc_heartbeat = Some(word),
            _ if address < a::PRESS_STROKE => half(&mut write.part_id, address, word, order),
            _ if address < a::PART_NUMBER => half(&mut write.press_stroke, address, word, order),
            _ if address < RESERVED => {
                if let Some(place) = write
                    .part_number
                    .get_mut(usize::from(address - a::PART_NUMBER))
                {
                    *place = Some(word);
                }
            }
            _ if word != 0 => return None,
            _ => {}
        }
    }
    Some(write)
}

/// The write of `bits` to the coils from `first` on: coil n is CONTROL bit n.
pub fn coil_write(first: u16, bits: &[bool]) -> ControlWrite {
    let mut control = Masked::default();
    for (coil, &set) in (first..16).zip(bits) {
        control.mask |= 1 << coil;
        control.value |= u16::from(set) << coil;
    }
    ControlWrite {
        control,
        ..Default::default()
    }
}

fn half(item: &mut Masked<u32>, address: u16, word: u16, order: WordOrder) {
    // 32-bit items sit at even addresses.
    let high = address.is_multiple_of(2) == (order == WordOrder::Normal);
    let shift = if high { 16 } else { 0 };
    item.mask |= 0xFFFF << shift;
    item.value |= u32::from(word) << shift;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_of_the_whole_block_names_everything() {
        let words: Vec<u16> = (1..=24).chain([0; 8]).collect();
        let write = control_write(0, &words, WordOrder::Normal).expect("a write");
        assert_eq!(
            (write.control, write.token, write.recipe_select),
            (Masked::<u16>::all(1), Some(2), Some(3))
        );
        assert_eq!(
            (write.part_id, write.press_stroke),
            (
                Masked::<u32>::all(0x0005_0006),
                Masked::<u32>::all(0x0007_0008)
            )
        );
        assert_eq!(
            (write.part_number[0], write.part_number[15]),
            (Some(9), Some(24))
        );
        let swapped = control_write(0, &words, WordOrder::Swapped).expect("a write");
        assert_eq!(swapped.part_id, Masked::<u32>::all(0x0006_0005));
    }

    #[test]
    fn half_an_item_names_that_half_only() {
        let write = control_write(5, &[9], WordOrder::Normal).expect("a write");
        assert_eq!(
            write.part_id,
            Masked {
                mask: 0xFFFF,
                value: 9
            }
        );
        let swapped = control_write(5, &[9], WordOrder::Swapped).expect("a write");
        assert_eq!(
            swapped.part_id,
            Masked {
                mask: 0xFFFF_0000,
                value: 9 << 16
            }
        );
    }

    #[test]
    fn reserved_registers_take_only_0() {
        assert!(control_write(24, &[0; 8], WordOrder::Normal).is_some());
        assert!(control_write(31, &[1], WordOrder::Normal).is_none());
    }

    #[test]
    fn coils_name_their_own_bits() {
        assert_eq!(
            coil_write(1, &[true, false]).control,
            Masked {
                mask: 0b110,
                value: 0b010
            }
        );
    }
}
