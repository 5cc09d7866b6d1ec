//! The daemon as a PLC sees it: the real binary, a socket, and a clock on the wall.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tokio_modbus::ExceptionCode;
use tokio_modbus::client::{Context, Reader as _, Writer as _, tcp};

/// Bits of STATUS.
const READY: u16 = 1 << 1;
const BUSY: u16 = 1 << 2;
const EXPOSURE_DONE: u16 = 1 << 4;
const RESULT_VALID: u16 = 1 << 5;
const RESULT_TOGGLE: u16 = 1 << 6;
const TRIGGER_ACK: u16 = 1 << 7;
const RECIPE_OK: u16 = 1 << 9;
/// Bits of CONTROL.
const ONLINE: u16 = 1;
const TRIGGER: u16 = 1 << 1;
const RESULT_ACK: u16 = 1 << 2;
/// Words of VERDICT and RECIPE_RESULT.
const PASS: u16 = 1;
const CORRUPT: u16 = 2;
/// Longest wait for anything that must happen.
const PATIENCE: Duration = Duration::from_secs(30);
/// SIGTERM ends the daemon within this time.
const STOPPING: Duration = Duration::from_secs(5);

/// A head with few pixels: where resolution does not matter, nothing waits for light.
pub const SMALL_HEAD: &str = "sub_rays = 2\n\n[rig.camera]\nwidth = 160\nheight = 160\n";

/// A configuration with a small simulated head beside a state folder, in a folder of its own.
pub struct Place {
    folder: TempDir,
}

impl Place {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("small.toml"), SMALL_HEAD).unwrap();
        let config = "state = \"state\"\n[head]\nscenario = \"small.toml\"\n";
        fs::write(folder.path().join("fringed.toml"), config).unwrap();
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn recipe(&self) -> PathBuf {
        self.path("state/recipes/0001.recipe")
    }
}

/// A running daemon. Dropped, it is killed.
pub struct Daemon {
    child: Child,
    /// Where it serves Modbus TCP.
    pub modbus: SocketAddr,
    /// What it said until it served.
    pub log: String,
}

impl Daemon {
    /// Starts the program and waits until it says where it serves.
    pub fn start(place: &Place) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_fringed-under-test"))
            .args(["serve", "--modbus", "127.0.0.1:0", "--http", "127.0.0.1:0"])
            .arg("--config")
            .arg(place.path("fringed.toml"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Read by a thread of its own, so that the daemon can go on logging and nothing waits for ever.
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let (said, hear) = mpsc::channel();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                // Nobody listens any more once it serves.
                let _ = said.send(line);
            }
        });
        let mut log = String::new();
        let modbus = loop {
            let Ok(line) = hear.recv_timeout(PATIENCE) else {
                let _ = child.kill();
                panic!("it does not serve: {:?}\n{log}", child.wait());
            };
            if let Some((_, rest)) = line.split_once("Modbus TCP on ") {
                break rest.split(',').next().unwrap().parse().unwrap();
            }
            log += &line;
            log += "\n";
        };
        Self { child, modbus, log }
    }

    fn terminate(mut self) -> ExitStatus {
        let pid = self.child.id().to_string();
        let told = Command::new("kill").args(["-TERM", &pid]).status().unwrap();
        assert!(told.success());
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(started.elapsed() < STOPPING, "SIGTERM did not end it");
            std::thread::yield_now();
        }
    }

    fn kill(mut self) {
        // SIGKILL: nothing is written, closed or said.
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

/// The STATUS block.
#[derive(Clone, Debug)]
struct Status(Vec<u16>);

impl Status {
    fn bits(&self) -> u16 {
        self.0[0]
    }

    fn has(&self, bits: u16) -> bool {
        self.bits() & bits == bits
    }

    fn active_recipe(&self) -> u16 {
        self.0[5]
    }

    fn crc(&self) -> u32 {
        long(&self.0, 6)
    }

    fn recipe_result(&self) -> u16 {
        self.0[9]
    }

    fn triggers(&self) -> u32 {
        long(&self.0, 10)
    }

    fn seq(&self) -> u32 {
        long(&self.0, 12)
    }

    fn missed(&self) -> u32 {
        long(&self.0, 14)
    }

    fn last_token(&self) -> u16 {
        self.0[16]
    }

    fn boot_id(&self) -> u32 {
        long(&self.0, 22)
    }
}

fn long(words: &[u16], at: usize) -> u32 {
    u32::from(words[at]) << 16 | u32::from(words[at + 1])
}

/// A PLC with one connection.
struct Plc {
    runtime: Runtime,
    context: Context,
}

impl Plc {
    fn connect(daemon: &Daemon) -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let context = runtime.block_on(tcp::connect(daemon.modbus)).unwrap();
        Self { runtime, context }
    }

    fn read(&mut self, address: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        let answer = self.context.read_holding_registers(address, count);
        self.runtime.block_on(answer).unwrap()
    }

    fn write(&mut self, address: u16, words: &[u16]) {
        let answer = self.context.write_multiple_registers(address, words);
        self.runtime.block_on(answer).unwrap().unwrap();
    }

    /// FC23: writes, then reads STATUS as it is after the write.
    fn write_and_read_status(&mut self, address: u16, words: &[u16]) -> Status {
        let answer = self
            .context
            .read_write_multiple_registers(100, 32, address, words);
        Status(self.runtime.block_on(answer).unwrap().unwrap())
    }

    fn status(&mut self) -> Status {
        Status(self.read(100, 32).unwrap())
    }

    fn wait(&mut self, what: &str, condition: impl Fn(&Status) -> bool) -> Status {
        let started = Instant::now();
        loop {
            let status = self.status();
            if condition(&status) {
                return status;
            }
            assert!(started.elapsed() < PATIENCE, "no {what}: {status:?}");
        }
    }

    /// Triggers by token and reads the result in one read of 120 registers.
    fn measure(&mut self, token: u16) -> Vec<u16> {
        self.wait("READY", |status| status.has(READY));
        self.write(1, &trigger(token));
        let started = Instant::now();
        loop {
            let words = self.read(200, 120).unwrap();
            if words[2] == token {
                return words;
            }
            assert!(started.elapsed() < PATIENCE, "no result");
        }
    }
}

/// TRIGGER_TOKEN, RECIPE_SELECT, PLC_HEARTBEAT, PART_ID and PRESS_STROKE.
fn trigger(token: u16) -> [u16; 7] {
    [token, 0, 0, 1, token, 2, token]
}

/// Checks what holds for every result of a good part.
fn check_pass(words: &[u16], status: &Status) {
    assert_eq!(words.len(), 120);
    assert_eq!(long(words, 0), long(words, 118), "SEQ at both ends");
    assert_eq!(long(words, 0), status.seq());
    assert_eq!(words[8], PASS, "error {}", words[9]);
    assert_eq!(words[3], status.active_recipe());
    assert_eq!(long(words, 4), status.crc());
    let gauges = u32::from(words[27]);
    assert!((1..=16).contains(&gauges));
    assert_eq!(long(words, 10), (1 << gauges) - 1, "every gauge passes");
    assert_eq!(long(words, 12), (1 << gauges) - 1, "every gauge is valid");
    let deviation = f32::from_bits(long(words, 64));
    assert!(deviation.is_finite() && deviation.abs() < 0.25);
}

#[test]
fn a_good_part_passes_by_the_edge_handshake() {
    let place = Place::new();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    // The first write of a connection sets the level that edges are counted from.
    plc.write(0, &[ONLINE]);
    let mut fields = vec![ONLINE | TRIGGER];
    fields.extend(trigger(0));
    let after = plc.write_and_read_status(0, &fields);
    assert!(after.has(BUSY | TRIGGER_ACK) && !after.has(READY));
    assert_eq!(after.bits() & (EXPOSURE_DONE | RESULT_VALID), 0);
    plc.write(0, &fields);
    plc.write(0, &[ONLINE]);
    plc.wait("EXPOSURE_DONE", |status| status.has(EXPOSURE_DONE));
    let done = plc.wait("result", |status| status.seq() != before.seq());
    assert!(done.has(READY | RESULT_VALID) && !done.has(TRIGGER_ACK));
    assert_eq!((done.bits() ^ before.bits()) & RESULT_TOGGLE, RESULT_TOGGLE);
    assert_eq!(done.seq(), before.seq() + 1);
    assert_eq!(done.triggers(), before.triggers() + 1);
    assert_eq!(done.missed(), before.missed());
    let words = plc.read(200, 120).unwrap();
    check_pass(&words, &done);
    assert_eq!(words[2], 0, "an edge has no token");
    assert_eq!((long(&words, 6), long(&words, 28)), (0x10000, 0x20000));
    plc.write(0, &[ONLINE | RESULT_ACK]);
    assert!(!plc.status().has(RESULT_VALID));
}

#[test]
fn a_retried_token_measures_once_and_refused_requests_change_nothing() {
    let place = Place::new();
    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let before = plc.wait("READY", |status| status.has(READY));
    let after = plc.write_and_read_status(1, &trigger(77));
    assert!(after.has(BUSY));
    assert_eq!(after.last_token(), 77);
    plc.write(1, &trigger(77));
    let words = plc.measure(77);
    plc.write(1, &trigger(77));
    // Another connection that retries the same write is answered the same way.
    Plc::connect(&daemon).write(1, &trigger(77));
    let done = plc.wait("READY", |status| status.has(READY));
    check_pass(&words, &done);
    assert_eq!((long(&words, 6), long(&words, 28)), (0x1004D, 0x2004D));
    assert_eq!((done.seq(), done.triggers()), (before.seq() + 1, 1));
    assert_eq!(done.missed(), 0);
    for (address, count) in [(40, 1), (120, 20), (1000, 1)] {
        assert_eq!(
            plc.read(address, count),
            Err(ExceptionCode::IllegalDataAddress)
        );
    }
    let reserved = plc.context.write_multiple_registers(0, &[ONLINE | 1 << 8]);
    assert_eq!(
        plc.runtime.block_on(reserved).unwrap(),
        Err(ExceptionCode::IllegalDataValue)
    );
    assert_eq!(plc.status().triggers(), 1);
}

#[test]
fn counters_go_on_and_the_recipe_stays_after_a_restart_and_after_kill_9() {
    let place = Place::new();
    let daemon = Daemon::start(&place);
    assert!(daemon.log.contains("taught recipe 1"), "{}", daemon.log);
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(5);
    let first = plc.status();
    check_pass(&words, &first);
    assert_eq!(first.seq(), 1);
    let taught = fs::read(place.recipe()).unwrap();
    assert_eq!(daemon.terminate().code(), Some(0));

    let daemon = Daemon::start(&place);
    assert!(!daemon.log.contains("taught"), "{}", daemon.log);
    let mut plc = Plc::connect(&daemon);
    let second = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    assert_eq!(second.seq(), 1, "RESULT_SEQ goes on");
    assert_eq!((second.last_token(), second.triggers()), (0, 0));
    assert_ne!(second.boot_id(), first.boot_id());
    assert_eq!(second.crc(), first.crc());
    // The same token as before the restart triggers again.
    assert_eq!(long(&plc.measure(5), 0), 2);
    // Killed with a cycle in flight: its SEQ may be lost, none is used twice.
    plc.write(1, &trigger(6));
    daemon.kill();

    let daemon = Daemon::start(&place);
    let mut plc = Plc::connect(&daemon);
    let third = plc.wait("READY", |status| status.has(READY | RECIPE_OK));
    assert!((2..=3).contains(&third.seq()), "{}", third.seq());
    assert_eq!(third.last_token(), 0);
    assert_ne!(third.boot_id(), second.boot_id());
    let words = plc.measure(5);
    assert_eq!(long(&words, 0), third.seq() + 1);
    check_pass(&words, &plc.status());
    assert_eq!(fs::read(place.recipe()).unwrap(), taught);
}

/// Damages a file in the middle.
fn damage(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_damaged_recipe_gives_way_to_the_generation_before_it_and_the_daemon_says_so() {
    let place = Place::new();
    let daemon = Daemon::start(&place);
    let crc = Plc::connect(&daemon).status().crc();
    daemon.kill();
    let previous = place.path("state/recipes/0001.recipe.previous");
    fs::copy(place.recipe(), previous).unwrap();
    damage(&place.recipe());
    let daemon = Daemon::start(&place);
    assert!(daemon.log.contains("0001.recipe"), "{}", daemon.log);
    assert!(
        daemon.log.contains("generation before it is used"),
        "{}",
        daemon.log
    );
    let mut plc = Plc::connect(&daemon);
    let words = plc.measure(9);
    let status = plc.status();
    assert_eq!(status.crc(), crc);
    check_pass(&words, &status);
}

#[test]
#[ignore = "appliance/src/daemon.rs: wait_until_ready waits for ever where a recipe cannot be loaded"]
fn without_a_usable_generation_the_daemon_serves_and_says_corrupt() {
    let place = Place::new();
    Daemon::start(&place).kill();
    damage(&place.recipe());
    let daemon = Daemon::start(&place);
    assert!(daemon.log.contains("0001.recipe"), "{}", daemon.log);
    let mut plc = Plc::connect(&daemon);
    let status = plc.wait("RECIPE_RESULT", |status| status.recipe_result() == CORRUPT);
    assert!(!status.has(RECIPE_OK) && !status.has(READY));
    assert_eq!(status.active_recipe(), 0);
    // A trigger is rejected: there is no recipe (REJECT_REASON 3).
    let rejected = plc.write_and_read_status(1, &trigger(3));
    assert_eq!((rejected.triggers(), rejected.missed()), (0, 1));
    assert_eq!(rejected.0[20], 3);
    assert_eq!(daemon.terminate().code(), Some(0));
}
