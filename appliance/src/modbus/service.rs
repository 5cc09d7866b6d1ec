//! One request of one connection: checks it, then reads one snapshot or applies one write.

use super::blocks::block_words;
use super::clients::{Refusals, RefusedPeer};
use super::map;
use super::map::at::control as a;
use crate::config::WordOrder;
use crate::station::{ConnectionEdges, ControlWrite, Identity, Masked, Snapshot, StationHandle};
use std::future::{Ready, ready};
use std::net::IpAddr;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tokio_modbus::server::Service;
use tokio_modbus::{ExceptionCode, Request, Response, SlaveRequest};

/// Most registers of one read.
pub const MAX_READ: u16 = 125;
/// Most registers of one FC16.
pub const MAX_WRITE: usize = 123;
/// Most registers written by one FC23.
pub const MAX_READ_WRITE: usize = 121;
/// Most coils or discrete inputs of one read.
pub const MAX_READ_BITS: u16 = 2000;
/// Most coils of one FC15.
pub const MAX_WRITE_BITS: usize = 1968;
/// Coils and discrete inputs: one word each.
const BITS: u16 = 16;

/// The guard's verdict on the frame that the library decodes next: 0, or the exception to answer
/// with.
pub type FrameFlaw = Arc<AtomicU8>;

/// The service of one connection.
pub struct PlcService {
    pub(super) handle: StationHandle,
    pub(super) word_order: WordOrder,
    pub(super) strict_unit_id: Option<u8>,
    pub(super) flaw: FrameFlaw,
    pub(super) edges: Mutex<ConnectionEdges>,
    pub(super) peer: IpAddr,
    pub(super) may_write: bool,
    pub(super) refusals: Refusals,
}

impl Service for PlcService {
    type Request = SlaveRequest<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: Self::Request) -> Self::Future {
        ready(self.answer(request))
    }
}

impl PlcService {
    fn answer(
        &self,
        SlaveRequest { slave, request }: SlaveRequest<'_>,
    ) -> Result<Response, ExceptionCode> {
        if self.strict_unit_id.is_some_and(|unit| unit != slave) {
            return Err(ExceptionCode::GatewayTargetDevice);
        }
        if !self.may_write && writes(&request) {
            self.refusals.note(RefusedPeer::Write, self.peer);
            return Err(ExceptionCode::IllegalFunction);
        }
        // A flawed frame was replaced by an empty one of its function, which must not be carried
        // out.
        match self.flaw.load(Ordering::Relaxed) {
            0 => {}
            flaw => return Err(ExceptionCode::new(flaw)),
        }
        match request {
            Request::ReadCoils(first, count) => {
                bits(self.handle.snapshot().control.control, first, count).map(Response::ReadCoils)
            }
            Request::ReadDiscreteInputs(first, count) => {
                bits(self.handle.snapshot().status, first, count).map(Response::ReadDiscreteInputs)
            }
            Request::ReadHoldingRegisters(first, count) => self
                .read(&self.handle.snapshot(), first, count)
                .map(Response::ReadHoldingRegisters),
            Request::ReadInputRegisters(first, count) => self
                .read(&self.handle.snapshot(), first, count)
                .map(Response::ReadInputRegisters),
            Request::WriteSingleCoil(coil, set) => {
                self.write_coils(coil, &[set])?;
                Ok(Response::WriteSingleCoil(coil, set))
            }
            Request::WriteMultipleCoils(first, coils) => {
                self.write_coils(first, &coils)?;
                Ok(Response::WriteMultipleCoils(first, quantity(coils.len())?))
            }
            Request::WriteSingleRegister(address, word) => {
                self.write(address, &[word], MAX_WRITE)?;
                Ok(Response::WriteSingleRegister(address, word))
            }
            Request::WriteMultipleRegisters(first, words) => {
                self.write(first, &words, MAX_WRITE)?;
                Ok(Response::WriteMultipleRegisters(
                    first,
                    quantity(words.len())?,
                ))
            }
            Request::ReadWriteMultipleRegisters(first, count, write_first, words) => {
                // Both ranges are checked before anything is written.
                check_read(first, count)?;
                let after = self.write(write_first, &words, MAX_READ_WRITE)?;
                self.read(&after, first, count)
                    .map(Response::ReadWriteMultipleRegisters)
            }
            Request::ReadDeviceIdentification(code, object) => {
                let answer =
                    identification(&self.handle.snapshot().identity, code.value(), object)?;
                Ok(Response::Custom(0x2B, answer.into()))
            }
            _ => Err(ExceptionCode::IllegalFunction),
        }
    }

    fn read(&self, snapshot: &Snapshot, first: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        let block = check_read(first, count)?;
        let start = usize::from(first - block.first);
        let words = block_words(snapshot, &block, self.word_order);
        let wanted = words.get(start..start + usize::from(count));
        wanted
            .map(<[u16]>::to_vec)
            .ok_or(ExceptionCode::ServerDeviceFailure)
    }

    fn write(
        &self,
        first: u16,
        words: &[u16],
        limit: usize,
    ) -> Result<Arc<Snapshot>, ExceptionCode> {
        if words.is_empty() || words.len() > limit {
            return Err(ExceptionCode::IllegalDataValue);
        }
        let block = map::served(first, quantity(words.len())?).filter(|block| block.writable);
        if block.is_none() {
            return Err(ExceptionCode::IllegalDataAddress);
        }
        let write =
            control_write(first, words, self.word_order).ok_or(ExceptionCode::IllegalDataValue)?;
        self.apply(write)
    }

    fn write_coils(&self, first: u16, coils: &[bool]) -> Result<Arc<Snapshot>, ExceptionCode> {
        if coils.is_empty() || coils.len() > MAX_WRITE_BITS {
            return Err(ExceptionCode::IllegalDataValue);
        }
        if usize::from(first) + coils.len() > usize::from(BITS) {
            return Err(ExceptionCode::IllegalDataAddress);
        }
        self.apply(coil_write(first, coils))
    }

    fn apply(&self, write: ControlWrite) -> Result<Arc<Snapshot>, ExceptionCode> {
        let mut edges = self.edges.lock().unwrap_or_else(PoisonError::into_inner);
        self.handle
            .write(&mut edges, write)
            .map_err(|_| ExceptionCode::IllegalDataValue)
    }
}

/// Whether a request would change something.
fn writes(request: &Request<'_>) -> bool {
    matches!(
        request,
        Request::WriteSingleCoil(..)
            | Request::WriteMultipleCoils(..)
            | Request::WriteSingleRegister(..)
            | Request::WriteMultipleRegisters(..)
            | Request::ReadWriteMultipleRegisters(..)
    )
}

fn quantity(count: usize) -> Result<u16, ExceptionCode> {
    u16::try_from(count).map_err(|_| ExceptionCode::IllegalDataValue)
}

fn check_read(first: u16, count: u16) -> Result<map::Block, ExceptionCode> {
    if count == 0 || count > MAX_READ {
        return Err(ExceptionCode::IllegalDataValue);
    }
    map::served(first, count).ok_or(ExceptionCode::IllegalDataAddress)
}

/// `count` bits of a word from bit `first` on.
fn bits(word: u16, first: u16, count: u16) -> Result<Vec<bool>, ExceptionCode> {
    if count == 0 || count > MAX_READ_BITS {
        return Err(ExceptionCode::IllegalDataValue);
    }
    if u32::from(first) + u32::from(count) > u32::from(BITS) {
        return Err(ExceptionCode::IllegalDataAddress);
    }
    Ok((first..first + count)
        .map(|bit| word >> bit & 1 == 1)
        .collect())
}

/// The answer to FC43/14 after its function code. `tokio-modbus` 0.17 does not export its type, so
/// the bytes are built here: MEI type, read code, conformity (0x83: extended, stream and
/// individual), more follows, next object, number of objects, objects.
///
/// Stream access (read code 1–3) starts at `object` if that exists, else at the first one; read
/// code 4 gives one object.
fn identification(
    identity: &Identity,
    read_code: u8,
    object: u8,
) -> Result<Vec<u8>, ExceptionCode> {
    let all = [
        (0x00, &identity.vendor),
        (0x01, &identity.product),
        (0x02, &identity.version),
        (0x04, &identity.product),
        (0x80, &identity.serial),
    ];
    let last = match read_code {
        1 => 0x02,
        2 => 0x7F,
        3 => 0xFF,
        _ => object,
    };
    let known = all.iter().any(|&(id, _)| id == object && id <= last);
    if read_code == 4 && !known {
        return Err(ExceptionCode::IllegalDataAddress);
    }
    let first = if known { object } else { 0 };
    let chosen: Vec<_> = all
        .into_iter()
        .filter(|(id, _)| (first..=last).contains(id))
        .collect();
    let count = u8::try_from(chosen.len()).unwrap_or(0);
    let mut answer = vec![14, read_code, 0x83, 0, 0, count];
    for (id, text) in chosen {
        // 32 bytes each keep the answer inside one frame.
        let text: Vec<u8> = text.bytes().take(32).collect();
        answer.push(id);
        answer.push(u8::try_from(text.len()).unwrap_or(0));
        answer.extend(text);
    }
    Ok(answer)
}

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
