//! Slow, silent and many clients.

use super::*;
use std::time::Duration;

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
async fn more_followers_than_places_are_turned_away() {
    let served = served().await;
    let mut open = Vec::new();
    for _ in 0..site::MAX_FOLLOWERS {
        let mut stream = TcpStream::connect(served.address).await.unwrap();
        let request = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n";
        stream.write_all(request).await.unwrap();
        let mut first = [0; 12];
        stream.read_exact(&mut first).await.unwrap();
        assert_eq!(&first, b"HTTP/1.1 200");
        open.push(stream);
    }
    assert_eq!(served.get("/events").await.status, 503);
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
