//! The server: which answer a request gets, and what a head sends that has a fault.

use super::results::{line, row};
use super::{Fault, Head, Plant, csv, now_ms, state};
use http_body_util::StreamBody;
use hyper::body::{Bytes, Frame};
use hyper::header::{CONTENT_TYPE, HeaderName, LOCATION};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Response, StatusCode, Uri};
use hyper_util::rt::TokioIo;
use std::future::pending;
use std::io;
use std::iter::{once, repeat_n};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::sleep;
use tokio_stream::wrappers::ReceiverStream;

/// Pause after a connection that could not be accepted, because no file descriptor is left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// The most results of one answer.
const MOST_RESULTS: u32 = 10_000;
/// Bytes of a line that is too long for any collector.
const LINE: usize = 1 << 30;
/// Bytes of a piece.
const PIECE: usize = 64 << 10;
/// Bytes that a slow head sends before each pause: 10 kB/s.
const SLOW: usize = 1000;
/// Pause of a slow head.
const PAUSE: Duration = Duration::from_millis(100);
/// Bytes after which a head breaks off: the header and part of a result.
const CUT: usize = 700;

/// The body of an answer, made while it is sent.
type Body = StreamBody<ReceiverStream<Result<Frame<Bytes>, io::Error>>>;
type Answer = Response<Body>;
/// The lines of an answer.
type Lines = Box<dyn Iterator<Item = Vec<u8>> + Send>;

/// Answers until the program is stopped.
pub async fn serve(listener: TcpListener, plant: Arc<Plant>) -> ! {
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                // Without it a short answer may wait for the acknowledgement of the one before.
                let _ = stream.set_nodelay(true);
                tokio::spawn(connection(TokioIo::new(stream), plant.clone()));
            }
            Err(_) => sleep(ACCEPT_PAUSE).await,
        }
    }
}

async fn connection(stream: TokioIo<TcpStream>, plant: Arc<Plant>) {
    let service = service_fn(|request| {
        let plant = plant.clone();
        async move { answer(&plant, hyper::Request::uri(&request)).await }
    });
    // A connection that either side breaks off is no error of the server.
    let _ = http1::Builder::new()
        .serve_connection(stream, service)
        .await;
}

/// The answer to a request of the path and query `uri`.
///
/// # Errors
/// If the head is off: the connection is to be closed without an answer.
pub async fn answer(plant: &Arc<Plant>, uri: &Uri) -> io::Result<Answer> {
    let path = uri.path().strip_prefix("/h/");
    let path = path.and_then(|path| path.split_once('/'));
    let head = path.and_then(|(number, path)| {
        let head = plant.head(number.parse().ok()?, now_ms())?;
        Some((head, path))
    });
    let Some((head, path)) = head else {
        return Ok(status(StatusCode::NOT_FOUND));
    };
    let fault = head.ails;
    match fault {
        Some(Fault::Silence) => pending().await,
        Some(Fault::Restart) => return Err(io::ErrorKind::ConnectionReset.into()),
        _ => {}
    }
    let query = uri.query().unwrap_or_default();
    let number = |name: &str, default: u32| {
        let mut parts = query.split('&').filter_map(|part| part.split_once('='));
        let given = parts.find(|(key, _)| *key == name);
        given
            .and_then(|(_, text)| text.parse().ok())
            .unwrap_or(default)
    };
    let (kind, whole) = match path {
        "api/results" if fault == Some(Fault::Redirect) => {
            let elsewhere = format!("/h/{:04}/api/results?{query}", head.next());
            let answer = status(StatusCode::TEMPORARY_REDIRECT);
            return Ok(with(answer, LOCATION, &elsewhere));
        }
        "api/results" => {
            let after = number("after", 0);
            let limit = number("limit", MOST_RESULTS).min(MOST_RESULTS);
            let hostile = fault.and_then(|fault| hostile(&head, fault, after));
            let lines = hostile.unwrap_or_else(|| results(&head, after, limit));
            let answer = Response::new(body(lines, fault));
            return Ok(with(answer, CONTENT_TYPE, "application/x-ndjson"));
        }
        "api/history.csv" => {
            let before = number("before_seq", u32::MAX);
            let text = csv::history(&head, before, number("limit", csv::MOST));
            ("text/csv; charset=utf-8", text.into_bytes())
        }
        "healthz" => ("text/plain", b"ok\n".to_vec()),
        "metrics" => (state::METRICS, state::metrics(&head).into_bytes()),
        "api/snapshot" => ("application/json", line(&state::snapshot(&head))),
        "api/recipes" => ("application/json", line(&state::recipes(&head))),
        "api/diagnostics.zip" => ("application/zip", state::diagnostics(&head)?),
        _ => match recipe(path).filter(|number| state::numbers(&head).contains(number)) {
            Some(number) => ("application/zip", state::file(&head, number)?),
            None => return Ok(status(StatusCode::NOT_FOUND)),
        },
    };
    Ok(with(
        Response::new(body(once(whole), fault)),
        CONTENT_TYPE,
        kind,
    ))
}

/// The number of `api/recipes/N/file`.
fn recipe(path: &str) -> Option<u16> {
    let number = path.strip_prefix("api/recipes/")?.strip_suffix("/file")?;
    number.parse().ok()
}

fn status(status: StatusCode) -> Answer {
    let mut answer = Response::new(body(once(status.to_string().into_bytes()), None));
    *answer.status_mut() = status;
    answer
}

fn with(mut answer: Answer, name: HeaderName, value: &str) -> Answer {
    let value = value.parse().ok();
    value.and_then(|value| answer.headers_mut().insert(name, value));
    answer
}

/// The header and the results behind `after`.
fn results(head: &Head, after: u32, limit: u32) -> Lines {
    let found = head.results(after.saturating_add(1)).take(limit as usize);
    let (header, head) = (line(&head.header()), head.clone());
    Box::new(once(header).chain(found.map(move |seq| line(&row(&head, seq)))))
}

/// The hostile answer to a request for results behind `after`, if the fault is one of that kind.
fn hostile(head: &Head, fault: Fault, after: u32) -> Option<Lines> {
    let mut head = head.clone();
    if fault == Fault::Serial {
        head = head.plant.head(head.next(), head.now_ms)?;
    }
    let header = line(&head.header());
    let seq = after.saturating_add(1);
    let made = move |seq: u32| line(&row(&head, seq));
    let rows: Lines = match fault {
        Fault::Endless => Box::new((seq..).map(made)),
        Fault::Line => Box::new(repeat_n(vec![b'1'; PIECE], LINE / PIECE)),
        Fault::Serial => Box::new(once(made(seq))),
        Fault::Falling => Box::new((seq..seq.saturating_add(3)).rev().map(made)),
        Fault::Nan => {
            let text = String::from_utf8(made(seq)).ok()?;
            let text = text.replacen(r#""value":"#, r#""value":NaN,"was":"#, 1);
            Box::new(once(text.into_bytes()))
        }
        _ => return None,
    };
    Some(Box::new(once(header).chain(rows)))
}

/// A body of lines, on a head with a fault or without one.
fn body(mut lines: impl Iterator<Item = Vec<u8>> + Send + 'static, fault: Option<Fault>) -> Body {
    let (sender, pieces) = mpsc::channel(1);
    let (most, mut left) = match fault {
        Some(Fault::Slow) => (SLOW, usize::MAX),
        Some(Fault::Cut) => (usize::MAX, CUT),
        _ => (usize::MAX, usize::MAX),
    };
    tokio::spawn(async move {
        while let Some(piece) = piece(&mut lines) {
            for part in piece.chunks(most) {
                if fault == Some(Fault::Slow) {
                    sleep(PAUSE).await;
                }
                let part = Bytes::copy_from_slice(&part[..part.len().min(left)]);
                left -= part.len();
                if sender.send(Ok(Frame::data(part))).await.is_err() {
                    return;
                }
                if left == 0 {
                    let broken = Err(io::ErrorKind::ConnectionAborted.into());
                    return drop(sender.send(broken).await);
                }
            }
        }
    });
    StreamBody::new(ReceiverStream::new(pieces))
}

fn piece(lines: &mut impl Iterator<Item = Vec<u8>>) -> Option<Vec<u8>> {
    let mut piece = lines.next()?;
    while piece.len() < PIECE
        && let Some(line) = lines.next()
    {
        piece.extend(line);
    }
    Some(piece)
}
