//! Runs the program, as often and as long as a test needs it.

use super::heads::{self, Options, serve};
use clap::Parser as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

/// Longest wait for what must happen at last.
const PATIENCE: Duration = Duration::from_secs(60);

/// The program with these arguments.
pub fn fleet(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fringed-fleet"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// Runs a command to its end.
pub fn ended(arguments: &[&str]) -> Output {
    fleet(arguments).output().unwrap()
}

/// A process that ends with the test.
pub struct Running(pub Child);

impl Running {
    /// SIGKILL.
    pub fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    /// Its exit code, once it has ended by itself.
    pub fn ended(mut self) -> Option<i32> {
        self.0.wait().unwrap().code()
    }

    /// SIGTERM; the exit code.
    pub fn terminate(mut self) -> Option<i32> {
        let id = self.0.id().to_string();
        assert!(Command::new("kill").arg(id).status().unwrap().success());
        self.0.wait().unwrap().code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Heads of the example `plant`, in a thread of their own until this is dropped.
pub struct Plant {
    /// `127.0.0.1:PORT`.
    pub address: String,
    count: u32,
    _stop: oneshot::Sender<()>,
}

impl Plant {
    /// So many heads with these options.
    pub fn of(count: u32, options: &[&str]) -> Self {
        let heads = count.to_string();
        let fixed = ["plant", "--listen", "127.0.0.1:0", "--heads", &heads];
        let options = Options::try_parse_from(fixed.iter().chain(options)).unwrap();
        let (stop, stopped) = oneshot::channel();
        let (bound, address) = std::sync::mpsc::channel();
        let answering = async move {
            let listener = TcpListener::bind(&options.listen).await.unwrap();
            bound.send(listener.local_addr().unwrap()).unwrap();
            tokio::select! {
                _ = stopped => (),
                never = serve(listener, heads::Plant::new(options)) => never,
            }
        };
        std::thread::spawn(|| {
            let mut runtime = tokio::runtime::Builder::new_current_thread();
            runtime.enable_all().build().unwrap().block_on(answering);
        });
        Self {
            address: address.recv().unwrap().to_string(),
            count,
            _stop: stop,
        }
    }

    /// The addresses of all heads.
    pub fn heads(&self) -> String {
        format!("http://{}/h/{{0001..{:04}}}", self.address, self.count)
    }
}

/// A folder with configuration, store and log of collectors.
pub struct Place(TempDir);

impl Place {
    /// With heads that are asked ten times a second.
    pub fn new(heads: &[&str], more: &str) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let rows: String = heads
            .iter()
            .map(|url| format!("[[heads]]\nurl = {url:?}\nline = \"one\"\n"))
            .collect();
        let text = format!("poll_s = 0.1\nstate_s = 1.0\n{more}\n{rows}");
        fs::write(place.path("fleet.toml"), text).unwrap();
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn file(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    /// The URL of the embedded store.
    pub fn store(&self) -> String {
        format!("sqlite:{}", self.file("plant.db"))
    }

    /// Starts a collector.
    pub fn collect(&self, store: &str, options: &[&str]) -> Running {
        let config = self.file("fleet.toml");
        let log = File::options()
            .create(true)
            .append(true)
            .open(self.path("log"))
            .unwrap();
        let mut command = fleet(&["collect", "--config", &config, "--store", store]);
        Running(command.args(options).stderr(log).spawn().unwrap())
    }

    pub fn log(&self) -> String {
        fs::read_to_string(self.path("log")).unwrap_or_default()
    }
}

/// The rows of a query to the embedded store, as numbers.
pub fn numbers(place: &Place, query: &str) -> Vec<(String, i64)> {
    let Ok(connection) = rusqlite::Connection::open(place.path("plant.db")) else {
        return Vec::new();
    };
    let read = |connection: &rusqlite::Connection| {
        let mut statement = connection.prepare(query)?;
        let rows = statement.query_map((), |row| Ok((row.get(0)?, row.get(1)?)))?;
        rows.collect::<rusqlite::Result<Vec<_>>>()
    };
    // Before a collector has made the tables there are no rows.
    read(&connection).unwrap_or_default()
}

/// Results of each head in the embedded store, by serial.
pub fn counted(place: &Place) -> Vec<(String, i64)> {
    numbers(
        place,
        "SELECT serial, count(*) FROM result GROUP BY serial ORDER BY serial",
    )
}

/// Waits until something is so.
pub fn wait(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(
            began.elapsed() < PATIENCE,
            "{what}: not within {PATIENCE:?}"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// The answer of a head, as text.
pub fn answer(plant: &Plant, path: &str) -> String {
    use std::io::{Read as _, Write as _};
    let mut stream = std::net::TcpStream::connect(&plant.address).unwrap();
    let request = format!("GET {path} HTTP/1.0\r\nHost: a\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text.split_once("\r\n\r\n").unwrap().1.to_owned()
}

/// Numbers from a seed (SplitMix64).
pub struct Random(pub u64);

impl Random {
    /// A number below `bound`.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (mixed ^ (mixed >> 31)) % bound
    }
}

/// Whether a file can be run from `PATH` or where servers are.
pub fn server(name: &str) -> Option<PathBuf> {
    let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin";
    path.split(':')
        .map(|folder| Path::new(folder).join(name))
        .find(|file| file.exists())
}
