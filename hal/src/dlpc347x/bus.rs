//! An I²C bus of the kernel, as the trait that the driver needs.
//!
//! `i2cdev` and `embedded-hal` are kept by the Rust embedded working group. `linux-embedded-hal`
//! has the same adapter, but brings a further version of `nix` and four more crates for it.

use embedded_hal::i2c::{self, ErrorKind, NoAcknowledgeSource, Operation};
use i2cdev::core::{I2CMessage as _, I2CTransfer as _};
use i2cdev::linux::{LinuxI2CBus, LinuxI2CError, LinuxI2CMessage};
use std::path::Path;

use crate::error::{DeviceKind, Error};

/// An open bus.
pub struct Bus(LinuxI2CBus);

/// An error of a transfer.
#[derive(Debug)]
pub struct BusError(LinuxI2CError);

impl Bus {
    /// Opens a bus by its device file.
    ///
    /// # Errors
    /// `Disconnected` if it is not there or this user may not open it.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let opened = LinuxI2CBus::new(path);
        opened.map(Self).map_err(|error| Error::Disconnected {
            device: DeviceKind::Projector,
            attempt: format!("open I²C bus {} of the projector's controller ({error})", path.display()),
            remedy: "switch the bus on (dtparam=i2c_arm=on in config.txt), let the user into its group (i2c), or name another with head.projector.controller_bus".into(),
        })
    }
}

impl i2c::Error for BusError {
    /// Errors of the kernel's drivers: `ENXIO` and `EREMOTEIO` mean that no device acknowledged
    /// (Documentation/i2c/fault-codes.rst).
    fn kind(&self) -> ErrorKind {
        let number = match &self.0 {
            LinuxI2CError::Errno(number) => Some(*number),
            LinuxI2CError::Io(error) => error.raw_os_error(),
        };
        match number.map(rustix::io::Errno::from_raw_os_error) {
            Some(rustix::io::Errno::NXIO | rustix::io::Errno::REMOTEIO) => {
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Unknown)
            }
            Some(rustix::io::Errno::AGAIN) => ErrorKind::ArbitrationLoss,
            Some(rustix::io::Errno::TIMEDOUT) => ErrorKind::Bus,
            _ => ErrorKind::Other,
        }
    }
}

impl i2c::ErrorType for Bus {
    type Error = BusError;
}

impl i2c::I2c for Bus {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), BusError> {
        let messages = operations.iter_mut().map(|operation| match operation {
            Operation::Read(into) => LinuxI2CMessage::read(into),
            Operation::Write(from) => LinuxI2CMessage::write(from),
        });
        let mut messages: Vec<_> = messages
            .map(|message| message.with_address(u16::from(address)))
            .collect();
        self.0.transfer(&mut messages).map_err(BusError)?;
        Ok(())
    }
}
