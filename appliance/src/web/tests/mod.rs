//! The page's server over real HTTP on a free port.

mod answers;
mod boundaries;
mod connections;
mod gate;
mod page;
mod results;
mod tries;

use std::net::SocketAddr;
use std::sync::{Arc, mpsc};
use std::time::Instant;

use serde_json::Value;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

use super::*;
use crate::access::{Access, ChangeRecord};
use crate::backup::Backups;
use crate::history::Reader;
use crate::history::studies::Studies;
use crate::production::commissioning::Commission;
use crate::production::commissioning::live::Live;
use crate::production::simulation::Simulation;
use crate::recipe::Store;
use crate::station::*;

/// A station whose measuring task is silent, and its page.
struct Served {
    address: SocketAddr,
    handle: StationHandle,
    site: Site,
    /// When browsers say that the start was.
    dated: mpsc::Receiver<u64>,
    secret: String,
    _folder: TempDir,
}

async fn served() -> Served {
    served_to(true).await
}

/// With a page that everybody may look at, or users alone.
async fn served_to(looking_is_open: bool) -> Served {
    let identity = Identity {
        vendor: "v".into(),
        product: "sensor".into(),
        serial: "SN-1".into(),
        version: "1".into(),
    };
    let settings = Settings {
        next_seq: 5,
        buffered: Default::default(),
        boot_id: 1,
        teach_allowed: false,
        identity: Arc::new(identity),
        limits: Limits::default(),
    };
    let folder = tempfile::tempdir().unwrap();
    let handle = StationHandle::new(Station::new(settings, Micros(0)), Instant::now(), |_| None);
    let record = ChangeRecord::of(folder.path(), 16 << 20);
    let opened = Access::open(&folder.path().join("access"), None, record).unwrap();
    let (dates, dated) = mpsc::channel();
    let (orders, _) = mpsc::channel();
    let (commission, _) = Commission::open(folder.path());
    let site = Site::new(Parts {
        is_stored: Box::new(|| true),
        station: handle.clone(),
        access: opened.access,
        recipes: Store::open(&folder.path().join("recipes")).unwrap(),
        calibration: Default::default(),
        last_cycle: Default::default(),
        seen: Default::default(),
        simulation: Simulation::new(orders.clone()),
        live: Live::new(orders, commission.clone()),
        commission,
        history: Reader::of(folder.path()),
        studies: Studies::of(folder.path()),
        date: Box::new(move |utc_us| dates.send(utc_us).is_ok()),
        log: Default::default(),
        registers: |_| serde_json::json!({ "registers": [] }),
        configuration: "threads = 0\n".into(),
        calibration_file: Some(folder.path().join("calibration.json")),
        hosts: vec!["sensor.local".into()],
        proxies: vec!["127.9.9.9/32".parse().unwrap()],
        looking_is_open,
        collectors: vec!["127.0.0.2/32".parse().unwrap()],
        backups: Backups::of(folder.path()),
        restart: None,
    });
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(serve(listener, site.clone(), std::future::pending()));
    Served {
        address,
        handle,
        site,
        dated,
        secret: opened.made.unwrap().secret,
        _folder: folder,
    }
}

/// What came back: status, header lines in small letters, body.
#[derive(Debug)]
struct Answer {
    status: u16,
    headers: String,
    body: String,
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    fn header(&self, name: &str) -> Option<&str> {
        let lines = self.headers.lines();
        let mut pairs = lines.filter_map(|line| line.split_once(": "));
        pairs
            .find(|(found, _)| *found == name)
            .map(|(_, value)| value)
    }
}

impl Served {
    /// Sends one request with these header lines; the Host is this device's address unless they
    /// name one.
    async fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let stream = TcpStream::connect(self.address).await.unwrap();
        self.asked(stream, method, path, headers, body).await
    }

    /// As [`Self::ask`], on a connection.
    async fn asked(
        &self,
        mut stream: TcpStream,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
        body: &str,
    ) -> Answer {
        let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\n");
        if !headers.iter().any(|(name, _)| *name == "Host") {
            text += &format!("Host: {}\r\n", self.address);
        }
        for (name, value) in headers {
            text += &format!("{name}: {value}\r\n");
        }
        text += &format!("Content-Length: {}\r\n\r\n{body}", body.len());
        stream.write_all(text.as_bytes()).await.unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).await.unwrap();
        let text = String::from_utf8_lossy(&bytes);
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        Answer {
            status: head
                .get(9..12)
                .and_then(|status| status.parse().ok())
                .unwrap_or(0),
            headers: head.to_owned(),
            body: body.to_owned(),
        }
    }

    /// The status of the answer to a request from another address of this machine.
    async fn from(&self, from: [u8; 4], method: &str, path: &str) -> u16 {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind((from, 0).into()).unwrap();
        let stream = socket.connect(self.address).await.unwrap();
        self.asked(stream, method, path, &[], "").await.status
    }

    async fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, &[], "").await
    }

    fn origin(&self) -> String {
        format!("http://{}", self.address)
    }

    /// A change as the page asks for it.
    async fn change(&self, method: &str, path: &str, cookie: &str, body: &str) -> Answer {
        let origin = self.origin();
        let headers = [("Origin", &*origin), ("Cookie", cookie)];
        self.ask(method, path, &headers, body).await
    }

    /// Signs in; the cookie.
    async fn sign_in(&self) -> String {
        let body = format!("{{\"secret\": \"{}\"}}", self.secret);
        self.sign_in_with(&body).await
    }

    /// Signs in with a body; the cookie.
    async fn sign_in_with(&self, body: &str) -> String {
        let answer = self.change("POST", "/api/session", "", body).await;
        assert_eq!(answer.status, 200, "{answer:?}");
        let cookie = answer.header("set-cookie").unwrap();
        cookie.split(';').next().unwrap().to_owned()
    }
}
