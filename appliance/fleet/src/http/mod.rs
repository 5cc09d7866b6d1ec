//! An HTTP/1.1 client for a thousand servers: one connection each, which stays open.
//!
//! It is made of `hyper`, which the daemon's server is made of as well: it takes any number of
//! connections on one thread, and gives bodies piece by piece, so that every bound is ours.
//! (`ureq` would need a thread per head, `reqwest` brings 40 crates more.) Redirects are not
//! followed: a head is where the configuration says. Encryption is `rustls` with `ring`, which
//! needs no library of the system.

mod url;

pub use url::Url;

use crate::error::{Exit, Result};
use http_body_util::{BodyExt as _, Full};
use hyper::body::{Bytes, Incoming};
use hyper::client::conn::http1::{self, SendRequest};
use hyper::{Method, Request, Response, header};
use hyper_util::rt::TokioIo;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use std::error::Error;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;

/// Longest wait for a connection.
const CONNECTING: Duration = Duration::from_secs(5);
/// Longest wait for the beginning of a head's answer, and for each next piece or line of it.
pub const ANSWERING: Duration = Duration::from_secs(10);
/// The most bytes of header lines.
const HEADER: usize = 64 << 10;
/// The most bytes of a message about an error that are kept.
const WORDS: usize = 300;

/// What a server does wrong, for people.
#[derive(Debug, thiserror::Error)]
pub enum HttpError {
    /// No connection.
    #[error("connect: {0}")]
    Connect(String),
    /// A connection that breaks off.
    #[error("the answer breaks off: {0}")]
    Broken(#[from] hyper::Error),
    /// Silence.
    #[error("no answer within {} s", .0.as_secs())]
    Silent(Duration),
    /// A status that is not 200, and what the server says about it.
    #[error("it answers {0}{1}")]
    Status(u16, String),
    /// An attempt to send us elsewhere.
    #[error("it redirects to {0:?}, which is refused: write the address that answers")]
    Redirect(String),
    /// A body that is too long.
    #[error("its answer is longer than {0} bytes")]
    Long(usize),
}

/// One server. Not to be shared: one question at a time.
pub struct Client {
    url: Url,
    tls: Option<Arc<ClientConfig>>,
    /// Of every request.
    pub headers: Vec<(&'static str, String)>,
    /// Longest wait for the beginning of an answer, and for each next piece of it.
    pub patience: Duration,
    open: Option<SendRequest<Full<Bytes>>>,
}

impl Client {
    /// A client without a connection, which the first question makes.
    pub fn new(url: Url, tls: Option<Arc<ClientConfig>>) -> Self {
        Self {
            url,
            tls,
            headers: Vec::new(),
            patience: ANSWERING,
            open: None,
        }
    }

    /// The address.
    pub fn url(&self) -> &Url {
        &self.url
    }

    /// Gives the connection up: for an answer that is not read to its end.
    pub fn close(&mut self) {
        self.open = None;
    }

    /// Asks for a path, and answers with the body if the status is 200.
    ///
    /// # Errors
    /// [`HttpError`]
    pub async fn get(&mut self, path: &str) -> Result<Incoming, HttpError> {
        self.ask(path, None).await
    }

    /// Asks for a path, or sends a body to it, and answers with the whole answer of at most `most`
    /// bytes.
    ///
    /// # Errors
    /// [`HttpError`]
    pub async fn whole(
        &mut self,
        path: &str,
        body: Option<Bytes>,
        most: usize,
    ) -> Result<Vec<u8>, HttpError> {
        let answer = self.ask(path, body).await?;
        self.read(answer, most).await
    }

    async fn read(&mut self, mut body: Incoming, most: usize) -> Result<Vec<u8>, HttpError> {
        let mut all = Vec::new();
        while let Some(piece) = within(self.patience, next(&mut body)).await? {
            if all.len() + piece.len() > most {
                self.close();
                return Err(HttpError::Long(most));
            }
            all.extend_from_slice(&piece);
        }
        Ok(all)
    }

    async fn ask(&mut self, path: &str, body: Option<Bytes>) -> Result<Incoming, HttpError> {
        let reused = self.open.is_some();
        let answer = match self.once(path, body.clone()).await {
            // The server may have closed a connection that was idle. Every question may be asked
            // twice: writing a row again changes nothing.
            Err(HttpError::Broken(_)) if reused => self.once(path, body).await?,
            answer => answer?,
        };
        let status = answer.status();
        if status.is_redirection() {
            let place = answer.headers().get(header::LOCATION);
            let place = String::from_utf8_lossy(place.map_or(b"", |place| place.as_bytes()));
            self.close();
            return Err(HttpError::Redirect(shortened(&place)));
        }
        if status != 200 {
            let words = self.read(answer.into_body(), HEADER).await;
            let words = words.unwrap_or_default();
            let words = String::from_utf8_lossy(&words);
            let words = match words.trim() {
                "" => String::new(),
                words => format!(": {}", shortened(words)),
            };
            return Err(HttpError::Status(status.as_u16(), words));
        }
        Ok(answer.into_body())
    }

    async fn once(
        &mut self,
        path: &str,
        body: Option<Bytes>,
    ) -> Result<Response<Incoming>, HttpError> {
        // Taken, so that a question that is given up leaves no connection in the middle of it.
        let mut open = match self.open.take() {
            Some(open) if !open.is_closed() => open,
            _ => within(CONNECTING, self.connect()).await?,
        };
        let method = if body.is_some() {
            Method::POST
        } else {
            Method::GET
        };
        let mut request = Request::builder()
            .method(method)
            .uri(format!("{}{path}", self.url.path))
            .header(header::HOST, self.url.authority());
        for (name, value) in &self.headers {
            request = request.header(*name, value);
        }
        let request = request.body(Full::new(body.unwrap_or_default()));
        let request = request.map_err(|error| HttpError::Connect(error.to_string()))?;
        let asked = async {
            open.ready().await?;
            Ok::<_, HttpError>(open.send_request(request).await?)
        };
        let answer = within(self.patience, asked).await?;
        self.open = Some(open);
        Ok(answer)
    }

    async fn connect(&self) -> Result<SendRequest<Full<Bytes>>, HttpError> {
        let failed = |error: io::Error| HttpError::Connect(error.to_string());
        let stream = TcpStream::connect((&*self.url.host, self.url.port)).await;
        let stream = stream.map_err(failed)?;
        // A small question must not wait for more to send.
        stream.set_nodelay(true).map_err(failed)?;
        if !self.url.tls {
            return speak(stream).await;
        }
        let missing = "https needs `ca`, the file of the authority that signed the certificate";
        let tls = self
            .tls
            .clone()
            .ok_or_else(|| failed(io::Error::other(missing)))?;
        let name = ServerName::try_from(self.url.host.clone());
        let name = name.map_err(|error| failed(io::Error::other(error)))?;
        let stream = TlsConnector::from(tls).connect(name, stream).await;
        speak(stream.map_err(|error| HttpError::Connect(of_tls(&error)))?).await
    }
}

/// Why an encrypted connection cannot be made, with the remedy where there is one.
fn of_tls(error: &io::Error) -> String {
    use rustls::CertificateError::{
        Expired, ExpiredContext, NotValidForName, NotValidForNameContext, NotValidYet,
        NotValidYetContext, UnknownIssuer,
    };
    let inner = error.get_ref().and_then(|inner| inner.downcast_ref());
    let words = match inner {
        Some(rustls::Error::InvalidCertificate(why)) => match why {
            UnknownIssuer => {
                "its certificate is signed by none of the authorities of `ca`: add the file of the one that signed it"
            }
            NotValidForName | NotValidForNameContext { .. } => {
                "its certificate is for another name: write that name in the address, or give it a certificate for this one"
            }
            Expired | ExpiredContext { .. } | NotValidYet | NotValidYetContext { .. } => {
                "its certificate is not valid today: renew it, or set the clock"
            }
            _ => return error.to_string(),
        },
        Some(rustls::Error::InvalidMessage(_)) => {
            "it does not speak https: write http:// in its address"
        }
        _ => return error.to_string(),
    };
    words.to_owned()
}

async fn speak(
    stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static,
) -> Result<SendRequest<Full<Bytes>>, HttpError> {
    let (sender, connection) = http1::Builder::new()
        .max_buf_size(HEADER)
        .handshake(TokioIo::new(stream))
        .await?;
    // It ends with the sender; an error of it is that of the question.
    tokio::spawn(connection);
    Ok(sender)
}

/// What comes within a time, or that nothing does.
///
/// # Errors
/// [`HttpError::Silent`], or that of `what`.
pub async fn within<T, E: From<HttpError>>(
    time: Duration,
    what: impl Future<Output = Result<T, E>>,
) -> Result<T, E> {
    let silent = |_| HttpError::Silent(time);
    timeout(time, what).await.map_err(silent)?
}

/// The next piece of a body; none at its end.
///
/// # Errors
/// [`HttpError`]
pub async fn next(body: &mut Incoming) -> Result<Option<Bytes>, HttpError> {
    while let Some(frame) = body.frame().await {
        // What is not data are trailers.
        if let Ok(piece) = frame?.into_data() {
            return Ok(Some(piece));
        }
    }
    Ok(None)
}

/// The beginning of a text from elsewhere.
pub fn shortened(text: &str) -> String {
    match text.char_indices().nth(WORDS) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text.to_owned(),
    }
}

/// A client configuration that trusts only the authorities in a PEM file of certificates.
///
/// # Errors
/// If the file cannot be read, or holds no certificate.
pub fn trusting(file: &Path) -> Result<Arc<ClientConfig>> {
    let wrong = Exit::Configuration.because(format!("read certificates of {}", file.display()));
    let config = ClientConfig::builder().with_root_certificates(roots(file).map_err(wrong)?);
    Ok(Arc::new(config.with_no_client_auth()))
}

fn roots(file: &Path) -> Result<RootCertStore, Box<dyn Error>> {
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(file)? {
        roots.add(certificate?)?;
    }
    if roots.is_empty() {
        return Err("there is none: write them as PEM".into());
    }
    Ok(roots)
}
