//! The target for HTTP: the bytes of one connection to the page's server.

use super::part::PART;
use super::plant::{runtime, settings};
use appliance::access::{Access, ChangeRecord};
use appliance::backup::Backups;
use appliance::history::Reader;
use appliance::history::studies::Studies;
use appliance::production::commissioning::Commission;
use appliance::production::commissioning::live::Live;
use appliance::production::latest::LastCycleRequests;
use appliance::production::simulation::Simulation;
use appliance::recipe::Store;
use appliance::station::{Micros, Station, StationHandle};
use appliance::web::{Parts, Site, serve};
use std::cell::RefCell;
use std::fs;
use std::future;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::Runtime;
use tokio::time::timeout;

/// The address from which sessions are opened: another one than that of the inputs, which may be
/// blocked after wrong guesses of the secret.
const ELSEWHERE: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));
/// Placeholder in an input for the token of a session.
const TOKEN: &[u8] = b"@T@";
/// Longest wait for the server to answer or close.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long a stream of events is read.
const FOLLOWED: Duration = Duration::from_millis(20);

/// A station that has measured nothing yet, and its page.
struct Page {
    runtime: Runtime,
    address: SocketAddr,
    access: Access,
    secret: String,
    /// Of the last session.
    token: RefCell<String>,
    recipes: PathBuf,
    _folder: TempDir,
}

thread_local! {
    static PAGE: Page = Page::new();
}

impl Page {
    fn new() -> Self {
        let runtime = runtime();
        let folder = tempfile::tempdir().expect("a folder");
        let station = Station::new(settings(), Micros(0));
        let station = StationHandle::new(station, Instant::now(), |_| None);
        let record = ChangeRecord::of(folder.path(), 1 << 20);
        let opened = Access::open(&folder.path().join("access"), None, record).expect("access");
        let access = opened.access;
        let recipes = folder.path().join("recipes");
        let (orders, _) = mpsc::channel();
        let (commission, _) = Commission::open(folder.path());
        let site = Site::new(Parts {
            is_stored: Box::new(|| true),
            station,
            access: access.clone(),
            recipes: Store::open(&recipes).expect("a store"),
            calibration: Default::default(),
            last_cycle: no_cycle(),
            seen: Default::default(),
            simulation: Simulation::new(orders.clone()),
            live: Live::new(orders, commission.clone()),
            commission,
            history: Reader::of(folder.path()),
            studies: Studies::of(folder.path()),
            date: Box::new(|_| false),
            log: Default::default(),
            registers: |_| serde_json::json!({ "registers": [] }),
            configuration: "threads = 0\n".into(),
            calibration_file: None,
            hosts: vec!["sensor.local".into()],
            proxies: Vec::new(),
            looking_is_open: true,
            collectors: Vec::new(),
            backups: Backups::of(folder.path()),
            restart: None,
        });
        let address = runtime.block_on(async {
            let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
            let address = listener.local_addr().expect("an address");
            tokio::spawn(serve(listener, site, future::pending()));
            address
        });
        Self {
            runtime,
            address,
            access,
            secret: opened.made.expect("a new device makes its secret").secret,
            token: RefCell::default(),
            recipes,
            _folder: folder,
        }
    }

    /// Restores the store, so that it holds exactly the taught recipe.
    fn put_back(&self) {
        for entry in fs::read_dir(&self.recipes).into_iter().flatten().flatten() {
            // A reader that has the file open can still read it.
            let _ = fs::remove_file(entry.path());
        }
        fs::write(self.recipes.join("0001.recipe"), &PART.bytes).expect("put back");
    }

    /// The bytes, with each placeholder replaced by the token of an open session.
    fn signed(&self, data: &[u8]) -> Vec<u8> {
        if !data.windows(TOKEN.len()).any(|window| window == TOKEN) {
            return data.to_vec();
        }
        let now = Instant::now();
        let mut token = self.token.borrow_mut();
        if self.access.signed_in(&token, now).is_none() {
            let session = self.access.sign_in(ELSEWHERE, None, &self.secret, now);
            *token = session.expect("the secret is right").0.text().to_owned();
        }
        let mut bytes = Vec::new();
        let mut rest = data;
        // From the front: of two placeholders that overlap, the first one is replaced.
        while let Some((&first, behind)) = rest.split_first() {
            match rest.strip_prefix(TOKEN) {
                Some(behind) => {
                    bytes.extend_from_slice(token.as_bytes());
                    rest = behind;
                }
                None => {
                    bytes.push(first);
                    rest = behind;
                }
            }
        }
        bytes
    }

    async fn exchange(&self, bytes: &[u8]) -> Vec<u8> {
        let mut stream = TcpStream::connect(self.address).await.expect("connected");
        // The server may close before it has read all.
        let _ = stream.write_all(bytes).await;
        let _ = stream.shutdown().await;
        let follows = bytes.windows(7).any(|window| window == b"/events");
        let wait = if follows { FOLLOWED } else { PATIENCE };
        let mut answer = Vec::new();
        let read = timeout(wait, stream.read_to_end(&mut answer)).await;
        assert!(
            read.is_ok() || follows,
            "the page neither answers nor closes"
        );
        answer
    }
}

/// The maps of the last cycle, with a thread that answers in place of the measuring task that there
/// was no cycle: without it each request for a picture would wait for seconds.
fn no_cycle() -> LastCycleRequests {
    let maps = LastCycleRequests::default();
    let asked = maps.clone();
    std::thread::spawn(move || {
        loop {
            if asked.wanted() {
                asked.answer(None);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    maps
}

/// The bytes of one connection; `@T@` stands for the token of a session. The page answers or
/// closes, and none of its workers panics.
pub fn http(data: &[u8]) {
    PAGE.with(|page| {
        page.put_back();
        let bytes = page.signed(data);
        let answer = page.runtime.block_on(page.exchange(&bytes));
        let answer = String::from_utf8_lossy(&answer);
        assert!(
            !(answer.starts_with("HTTP/1.1 500") && answer.contains("working it out failed")),
            "a worker of the page panicked: {answer}"
        );
    });
}
