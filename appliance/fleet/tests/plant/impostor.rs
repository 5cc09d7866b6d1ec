//! A server that answers what no head answers.

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// What it sends for a path: pieces until there are none, or the client is gone.
pub type Pieces = Box<dyn Iterator<Item = Vec<u8>>>;
type Answers = fn(&str, usize) -> Pieces;

/// A server on a free port.
pub struct Impostor {
    pub port: u16,
    /// Bytes that the clients took.
    pub sent: Arc<AtomicUsize>,
}

impl Impostor {
    /// Answers each question with what `answers` makes of its path, and of how many came before.
    pub fn new(answers: Answers, encrypted: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let sent = Arc::new(AtomicUsize::new(0));
        let count = Arc::new(AtomicUsize::new(0));
        let tls = encrypted.then(identity);
        let all = sent.clone();
        thread::spawn(move || {
            for stream in listener.incoming() {
                let (tls, all, count) = (tls.clone(), all.clone(), count.clone());
                thread::spawn(move || {
                    // A client that is gone is what some answers are for.
                    let _ = converse(stream.unwrap(), tls, answers, &all, &count);
                });
            }
        });
        Self { port, sent }
    }
}

trait Both: Read + Write {}
impl<T: Read + Write> Both for T {}

fn converse(
    stream: TcpStream,
    tls: Option<Arc<ServerConfig>>,
    answers: Answers,
    sent: &AtomicUsize,
    count: &AtomicUsize,
) -> std::io::Result<()> {
    let stream: Box<dyn Both> = match tls {
        Some(tls) => {
            let connection = ServerConnection::new(tls).map_err(std::io::Error::other)?;
            Box::new(StreamOwned::new(connection, stream))
        }
        None => Box::new(stream),
    };
    let mut stream = BufReader::new(stream);
    let mut request = String::new();
    stream.read_line(&mut request)?;
    let mut line = String::new();
    while line != "\r\n" {
        line.clear();
        stream.read_line(&mut line)?;
    }
    let path = request.split(' ').nth(1).unwrap_or_default();
    let before = count.fetch_add(1, Ordering::Relaxed);
    let stream = stream.get_mut();
    for piece in answers(path, before) {
        stream.write_all(&piece)?;
        sent.fetch_add(piece.len(), Ordering::Relaxed);
    }
    stream.flush()
}

/// Localhost's certificate and key.
fn identity() -> Arc<ServerConfig> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/plant/certificates");
    let certificate = CertificateDer::from_pem_file(folder.join("localhost.pem")).unwrap();
    let key = PrivateKeyDer::from_pem_file(folder.join("localhost.key")).unwrap();
    let config = ServerConfig::builder().with_no_client_auth();
    Arc::new(config.with_single_cert(vec![certificate], key).unwrap())
}
