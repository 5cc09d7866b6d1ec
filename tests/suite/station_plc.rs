//! The daemon with a small simulated head, and a PLC as its client.

use crate::written::FRINGED;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::Duration;
use tempfile::TempDir;
use tests::once::Once;
use tests::until::{PATIENCE, until};
use tokio::runtime::Runtime;
use tokio_modbus::ExceptionCode;
use tokio_modbus::client::{Context, Reader as _, Writer as _, tcp};

/// Bits of STATUS.
pub const READY: u16 = 1 << 1;
pub const BUSY: u16 = 1 << 2;
pub const EXPOSURE_DONE: u16 = 1 << 4;
pub const RESULT_VALID: u16 = 1 << 5;
pub const RESULT_TOGGLE: u16 = 1 << 6;
pub const TRIGGER_ACK: u16 = 1 << 7;
pub const RECIPE_OK: u16 = 1 << 9;
/// Bits of CONTROL.
pub const ONLINE: u16 = 1;
pub const TRIGGER: u16 = 1 << 1;
pub const RESULT_ACK: u16 = 1 << 2;
/// SIGTERM ends the daemon within this time.
pub const STOPPING: Duration = Duration::from_secs(5);

/// A head with few pixels, for tests in which resolution does not matter: its light takes little
/// time to compute.
pub const SMALL_HEAD: &str = "sub_rays = 2\n\n[rig.camera]\nwidth = 160\nheight = 160\n";

/// A folder with the configuration of a small simulated head, and a state folder.
pub struct Place {
    folder: TempDir,
}

impl Place {
    /// Nothing has been started here, and the head sees the default part.
    pub fn new() -> Self {
        Self::before(SMALL_HEAD)
    }

    /// Nothing has been started here, in front of this scene.
    pub fn before(scene: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("small.toml"), scene).unwrap();
        let config = "state = \"state\"\n[head]\nscenario = \"small.toml\"\n";
        fs::write(folder.path().join("fringed.toml"), config).unwrap();
        Self { folder }
    }

    /// A first start taught the default part as recipe 1. Serial, secret and history are still to
    /// be made.
    pub fn taught() -> Self {
        Self::taught_before(SMALL_HEAD)
    }

    /// As [`Place::taught`], in front of this scene. Each is taught once for all tests.
    pub fn taught_before(scene: &str) -> Self {
        static TAUGHT: Once<String, Vec<u8>> = Once::new();
        let place = Self::before(scene);
        let recipe = TAUGHT.get(scene.to_owned(), || {
            let first = Self::before(scene);
            assert_eq!(Daemon::start(&first).terminate().code(), Some(0));
            fs::read(first.recipe()).unwrap()
        });
        fs::create_dir_all(place.recipe().parent().unwrap()).unwrap();
        fs::write(place.recipe(), &*recipe).unwrap();
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Puts a pipe in place of the result counter's file: a write waits until somebody reads, as on
    /// a busy disk. Returns the file.
    pub fn counter_that_hangs(&self) -> PathBuf {
        let counter = self.path("state/result-seq");
        fs::remove_file(&counter).unwrap();
        let (kind, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::RWXU);
        rustix::fs::mknodat(rustix::fs::CWD, &counter, kind, mode, 0).unwrap();
        counter
    }

    pub fn recipe(&self) -> PathBuf {
        self.path("state/recipes/0001.recipe")
    }
}

/// A killed daemon leaves its last results in shared memory; no later one of this place needs them.
impl Drop for Place {
    fn drop(&mut self) {
        if let Ok(serial) = fs::read_to_string(self.path("state/serial")) {
            let _ = fs::remove_file(format!("/dev/shm/fringed-{}", serial.trim()));
        }
    }
}

/// The command that starts the daemon of a place.
pub fn command(place: &Place) -> Command {
    let mut command = Command::new(FRINGED);
    command
        .args(["serve", "--modbus", "127.0.0.1:0", "--http", "127.0.0.1:0"])
        .arg("--config")
        .arg(place.path("fringed.toml"))
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    command
}

/// A running daemon. It is killed on drop.
pub struct Daemon {
    child: Child,
    /// The address of its Modbus TCP server.
    pub modbus: SocketAddr,
    /// The address of the page.
    pub http: SocketAddr,
    /// Its log up to the moment when it serves.
    pub log: String,
}

impl Daemon {
    /// Starts the program and waits until it prints its addresses.
    pub fn start(place: &Place) -> Self {
        Self::of(command(place))
    }

    /// Starts a changed command, and waits until it prints its addresses.
    pub fn of(mut command: Command) -> Self {
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        // A thread reads the log, so the daemon can continue to log and nothing waits for ever.
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let (said, hear) = mpsc::channel();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                // Once it serves, nobody receives the lines.
                let _ = said.send(line);
            }
        });
        let mut log = String::new();
        let (modbus, http) = loop {
            let Ok(line) = hear.recv_timeout(PATIENCE) else {
                let _ = child.kill();
                panic!("it does not serve: {:?}\n{log}", child.wait());
            };
            if let Some((_, rest)) = line.split_once("Modbus TCP on ") {
                let (modbus, page) = rest.split_once(", page on http://").unwrap();
                break (modbus.parse().unwrap(), page.trim().parse().unwrap());
            }
            log += &line;
            log += "\n";
        };
        Self {
            child,
            modbus,
            http,
            log,
        }
    }

    /// Starts the program with a stderr that tells the test nothing, and waits until it is ready.
    pub fn unheard(place: &Place, stderr: impl Into<Stdio>) -> Self {
        let free = || TcpListener::bind("127.0.0.1:0").unwrap();
        let [modbus, http] = [free(), free()].map(|free| free.local_addr().unwrap());
        let mut command = Command::new(FRINGED);
        command
            .args(["serve", "--modbus", &modbus.to_string()])
            .args(["--http", &http.to_string(), "--config"])
            .arg(place.path("fringed.toml"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(stderr);
        let daemon = Self {
            child: command.spawn().unwrap(),
            modbus,
            http,
            log: String::new(),
        };
        // It opens its head and teaches meanwhile.
        until("server", 4 * PATIENCE, || TcpStream::connect(modbus));
        Plc::at(modbus).wait("READY", |status| status.has(READY));
        daemon
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    pub fn terminate(mut self) -> ExitStatus {
        end_by("-TERM", &mut self.child)
    }

    pub fn kill(mut self) {
        // SIGKILL: the daemon can write, close and print nothing more.
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Ends a daemon by a signal that it handles.
pub fn end_by(signal: &str, child: &mut Child) -> ExitStatus {
    let pid = child.id().to_string();
    let told = Command::new("kill").args([signal, &pid]).status();
    assert!(told.unwrap().success());
    until(&format!("end by {signal}"), STOPPING, || {
        child.try_wait().unwrap().ok_or(())
    })
}

/// The STATUS block.
#[derive(Clone, Debug)]
pub struct Status(pub Vec<u16>);

impl Status {
    pub fn bits(&self) -> u16 {
        self.0[0]
    }

    pub fn has(&self, bits: u16) -> bool {
        self.bits() & bits == bits
    }

    pub fn active_recipe(&self) -> u16 {
        self.0[5]
    }

    pub fn crc(&self) -> u32 {
        long(&self.0, 6)
    }

    pub fn recipe_result(&self) -> u16 {
        self.0[9]
    }

    pub fn triggers(&self) -> u32 {
        long(&self.0, 10)
    }

    pub fn seq(&self) -> u32 {
        long(&self.0, 12)
    }

    pub fn missed(&self) -> u32 {
        long(&self.0, 14)
    }

    pub fn last_token(&self) -> u16 {
        self.0[16]
    }

    pub fn boot_id(&self) -> u32 {
        long(&self.0, 22)
    }
}

/// 32 bits, high word first.
pub fn long(words: &[u16], at: usize) -> u32 {
    u32::from(words[at]) << 16 | u32::from(words[at + 1])
}

/// A PLC with one connection.
pub struct Plc {
    pub runtime: Runtime,
    pub context: Context,
}

impl Plc {
    pub fn connect(daemon: &Daemon) -> Self {
        Self::at(daemon.modbus)
    }

    pub fn at(modbus: SocketAddr) -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let context = runtime.block_on(tcp::connect(modbus)).unwrap();
        Self { runtime, context }
    }

    pub fn read(&mut self, address: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        let answer = self.context.read_holding_registers(address, count);
        self.runtime.block_on(answer).unwrap()
    }

    pub fn write(&mut self, address: u16, words: &[u16]) {
        let answer = self.context.write_multiple_registers(address, words);
        self.runtime.block_on(answer).unwrap().unwrap();
    }

    /// FC23: writes, then reads STATUS after the write.
    pub fn write_and_read_status(&mut self, address: u16, words: &[u16]) -> Status {
        let answer = self
            .context
            .read_write_multiple_registers(100, 32, address, words);
        Status(self.runtime.block_on(answer).unwrap().unwrap())
    }

    pub fn status(&mut self) -> Status {
        Status(self.read(100, 32).unwrap())
    }

    pub fn wait(&mut self, what: &str, condition: impl Fn(&Status) -> bool) -> Status {
        until(what, PATIENCE, || {
            let status = self.status();
            match condition(&status) {
                true => Ok(status),
                false => Err(status),
            }
        })
    }

    /// Triggers by token and reads the result in one read of 120 registers.
    pub fn measure(&mut self, token: u16) -> Vec<u16> {
        self.wait("READY", |status| status.has(READY));
        self.write(1, &trigger(token));
        self.result(token)
    }

    /// The result of this token, as soon as it is there.
    pub fn result(&mut self, token: u16) -> Vec<u16> {
        until(&format!("result of token {token}"), PATIENCE, || {
            let words = self.read(200, 120).unwrap();
            match words[2] == token {
                true => Ok(words),
                false => Err(words[2]),
            }
        })
    }
}

/// TRIGGER_TOKEN, RECIPE_SELECT, PLC_HEARTBEAT, PART_ID and PRESS_STROKE.
pub fn trigger(token: u16) -> [u16; 7] {
    [token, 0, 0, 1, token, 2, token]
}
