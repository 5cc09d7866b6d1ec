//! Slow, silent and many clients.

use super::*;
use std::net::IpAddr;
use std::time::Duration;
use tokio::net::TcpSocket;

const EVENTS: &str = "GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n";
const HEALTH: &str = "GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
/// The longest that somebody who only looks waits under attack.
const PROMPT: Duration = Duration::from_millis(200);
/// Long enough to see whether a connection has been closed.
const SHORT: Duration = Duration::from_millis(20);

/// A connection from an address of this machine, with a request sent.
async fn connect_from(served: &Served, from: [u8; 4], request: &str) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((IpAddr::from(from), 0).into()).unwrap();
    let mut stream = socket.connect(served.address).await.unwrap();
    // Where it has been closed already, the answer is missing.
    let _ = stream.write_all(request.as_bytes()).await;
    stream
}

async fn ask_from(served: &Served, host: u8, request: &str) -> TcpStream {
    connect_from(served, [127, 0, 0, host], request).await
}

/// The status of the answer; none if the connection was closed.
async fn status(stream: &mut TcpStream) -> Option<u16> {
    let mut first = [0; 12];
    stream.read_exact(&mut first).await.ok()?;
    std::str::from_utf8(&first[9..]).ok()?.parse().ok()
}

/// Longer than any time-out of the server that a test waits for.
const PATIENCE: Duration = Duration::from_secs(15);

#[tokio::test]
async fn events_bring_the_snapshot_at_once_and_again_when_it_changes() {
    let served = served().await;
    let mut stream = TcpStream::connect(served.address).await.unwrap();
    let request = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n";
    stream.write_all(request).await.unwrap();
    let mut seen = String::new();
    let mut buffer = [0; 4096];
    for state in ["\"state\":\"boot\"", "\"state\":\"ready\""] {
        while !seen.contains(state) {
            let count = stream.read(&mut buffer).await.unwrap();
            assert!(count > 0, "the stream ended after {seen}");
            seen.push_str(&String::from_utf8_lossy(&buffer[..count]));
        }
        served.handle.event(Event::Started);
    }
    assert!(seen.contains("text/event-stream") && seen.contains("event: snapshot"));
}

#[tokio::test]
async fn more_followers_than_places_are_turned_away_and_no_address_keeps_another_one_from_following()
 {
    let served = served().await;
    let mut open = Vec::new();
    for host in [1, 2] {
        for _ in 0..site::MAX_FOLLOWERS_EACH {
            let mut stream = ask_from(&served, host, EVENTS).await;
            assert_eq!(status(&mut stream).await, Some(200));
            open.push(stream);
        }
        let refused = &mut ask_from(&served, host, EVENTS).await;
        assert_eq!(status(refused).await, Some(503));
        // The refusal ends the connection.
        let mut rest = Vec::new();
        let ended = tokio::time::timeout(PATIENCE, refused.read_to_end(&mut rest)).await;
        ended.expect("the connection stays open").unwrap();
    }
    assert_eq!(open.len(), site::MAX_FOLLOWERS);
    let mut third = ask_from(&served, 3, EVENTS).await;
    assert_eq!(status(&mut third).await, Some(200));
}

/// A technician's request for `/healthz` from an address; it must be answered in time.
async fn prompt(served: &Served, host: u8) {
    let began = Instant::now();
    let mut stream = ask_from(served, host, HEALTH).await;
    assert_eq!(status(&mut stream).await, Some(200), "from {host}");
    let took = began.elapsed();
    assert!(took < PROMPT, "{took:?}");
}

#[tokio::test]
async fn sixty_four_refused_followers_delay_nobody() {
    for hosts in [&[1][..], &[1, 2, 3, 4, 5, 6, 7, 8]] {
        let served = served().await;
        let mut crowd = Vec::new();
        for at in 0..64 {
            crowd.push(ask_from(&served, hosts[at % hosts.len()], EVENTS).await);
        }
        for round in 0..20 {
            prompt(&served, 9).await;
            prompt(&served, hosts[0]).await;
            // Those who were refused come again.
            for stream in crowd.iter_mut().skip(16) {
                *stream = ask_from(&served, hosts[round % hosts.len()], EVENTS).await;
            }
        }
    }
}

#[tokio::test]
async fn requests_that_never_end_and_answers_that_nobody_reads_keep_no_other_address_out() {
    let served = served().await;
    let endless = format!(
        "POST /api/session HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nContent-Length: 100\r\n\r\n{{",
        served.address
    );
    // Answered and waiting for the next request, but by its path it looks like a follower.
    let foreign = "GET /events HTTP/1.1\r\nHost: evil.example\r\n\r\n";
    for attack in [
        &endless,
        foreign,
        EVENTS,
        "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
    ] {
        let mut crowd = Vec::new();
        for at in 0..96 {
            crowd.push(ask_from(&served, 1 + at % 6, attack).await);
        }
        for _ in 0..10 {
            prompt(&served, 9).await;
        }
    }
}

#[tokio::test]
async fn one_address_holds_at_most_sixteen_connections_and_a_proxy_more() {
    let served = served().await;
    let mut silent = Vec::new();
    for _ in 0..40 {
        silent.push(ask_from(&served, 1, "GET / HT").await);
    }
    prompt(&served, 2).await;
    let began = Instant::now();
    while silent.len() > 16 && began.elapsed() < PATIENCE {
        let mut first = silent.remove(0);
        let ended = tokio::time::timeout(SHORT, first.read(&mut [0; 16])).await;
        if ended.is_err() {
            silent.push(first);
        }
    }
    for stream in &mut silent {
        let ended = tokio::time::timeout(SHORT, stream.read(&mut [0; 16])).await;
        assert!(ended.is_err(), "fewer than 16 are left");
    }
    assert_eq!(silent.len(), 16);
    // A proxy's followers hold their places while they are answered, also above the share of an
    // address.
    let proxy = |request| connect_from(&served, [127, 9, 9, 9], request);
    let mut through = Vec::new();
    for _ in 0..site::MAX_FOLLOWERS {
        through.push(proxy(EVENTS).await);
    }
    for stream in &mut through {
        assert_eq!(status(stream).await, Some(200));
    }
    assert_eq!(status(&mut proxy(HEALTH).await).await, Some(200));
}

#[tokio::test]
async fn a_crowd_of_silent_connections_pushes_out_itself_and_nobody_else() {
    let served = served().await;
    let mut follower = TcpStream::connect(served.address).await.unwrap();
    let request = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n";
    follower.write_all(request).await.unwrap();
    let mut first = [0; 12];
    follower.read_exact(&mut first).await.unwrap();
    let mut crowd = Vec::new();
    for _ in 0..200 {
        let mut stream = TcpStream::connect(served.address).await.unwrap();
        stream.write_all(b"GET / HT").await.unwrap();
        crowd.push(stream);
    }
    assert_eq!(served.get("/healthz").await.status, 200);
    served.handle.event(Event::Started);
    let mut seen = String::new();
    let mut buffer = [0; 4096];
    while !seen.contains("\"state\":\"ready\"") {
        let count = follower.read(&mut buffer).await.unwrap();
        assert!(count > 0, "the follower lost its place");
        seen.push_str(&String::from_utf8_lossy(&buffer[..count]));
    }
    // The first of the crowd has been closed for the sake of the newcomers.
    assert!(!matches!(crowd[0].read(&mut buffer).await, Ok(1..)));
}

#[tokio::test]
async fn a_header_that_never_ends_is_given_up() {
    let served = served().await;
    let mut stream = TcpStream::connect(served.address).await.unwrap();
    stream
        .write_all(b"GET / HTTP/1.1\r\nHost: loc")
        .await
        .unwrap();
    let mut rest = Vec::new();
    let ended = tokio::time::timeout(PATIENCE, stream.read_to_end(&mut rest)).await;
    assert!(ended.is_ok(), "the connection stays open");
}

#[tokio::test]
async fn a_body_that_is_too_long_or_never_ends_is_refused() {
    let served = served().await;
    let long = format!("{{\"secret\": \"{}\"}}", "0".repeat(70_000));
    assert_eq!(
        served
            .change("POST", "/api/session", "", &long)
            .await
            .status,
        413
    );
    let mut stream = TcpStream::connect(served.address).await.unwrap();
    let head = format!(
        "POST /api/session HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nContent-Length: 100\r\n\r\n{{",
        served.address
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut first = [0; 12];
    let answered = tokio::time::timeout(PATIENCE, stream.read_exact(&mut first)).await;
    answered.expect("an answer in time").unwrap();
    assert_eq!(&first, b"HTTP/1.1 408");
}

#[tokio::test]
async fn only_a_few_files_are_on_their_way_at_a_time_and_others_are_told_to_wait() {
    let served = served().await;
    let places = served.site.files.clone();
    let taken = places.acquire_many_owned(4).await.unwrap();
    let answer = served.get("/api/diagnostics.zip").await;
    assert!(
        answer.status == 503 && answer.body.contains("wait"),
        "{answer:?}"
    );
    drop(taken);
    for _ in 0..8 {
        assert_eq!(served.get("/api/diagnostics.zip").await.status, 200);
    }
}
