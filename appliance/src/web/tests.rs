//! The page's server over real HTTP on a free port.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::*;
use crate::station::*;

struct Served {
    address: SocketAddr,
    handle: StationHandle,
}

async fn served(picture: Option<Vec<u8>>) -> Served {
    let identity = Identity {
        vendor: "v".into(),
        product: "sensor".into(),
        serial: "SN-1".into(),
        version: "1".into(),
    };
    let settings = Settings {
        next_seq: 5,
        boot_id: 1,
        teach_allowed: false,
        identity: Arc::new(identity),
        limits: Limits::default(),
    };
    let handle = StationHandle::new(Station::new(settings, Micros(0)), Instant::now(), |_| None);
    let listener = bind("127.0.0.1:0".parse().unwrap()).await.unwrap();
    let address = listener.local_addr().unwrap();
    let site = Site::new(
        handle.clone(),
        Arc::new(move || picture.clone()),
        vec!["sensor.local".into()],
    );
    tokio::spawn(serve(listener, site, std::future::pending()));
    Served { address, handle }
}

async fn get_as(address: SocketAddr, path: &str, host: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

async fn get(address: SocketAddr, path: &str) -> String {
    get_as(address, path, &address.to_string()).await
}

#[tokio::test]
async fn the_page_comes_whole_from_this_device_and_allows_nothing_inline() {
    let served = served(None).await;
    let page = get(served.address, "/").await;
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    assert!(
        page.contains("content-security-policy: default-src 'self'"),
        "{page}"
    );
    for needle in ["http://", "https://", "style=", "onclick", "<style"] {
        assert!(!page.contains(needle), "the page contains {needle}");
    }
    for path in ["/page.css", "/page.js", "/icon.svg"] {
        assert!(
            page.contains(path) && get(served.address, path).await.starts_with("HTTP/1.1 200"),
            "{path}"
        );
    }
}

#[tokio::test]
async fn every_element_that_the_script_names_is_on_the_page() {
    let (page, script) = (
        include_str!("assets/index.html"),
        include_str!("assets/page.js"),
    );
    let mut found = 0;
    for call in ["$(\"", "text(\"", "show(\""] {
        for rest in script.split(call).skip(1) {
            let id = rest.split('"').next().unwrap();
            assert!(page.contains(&format!("id=\"{id}\"")), "no element {id}");
            found += 1;
        }
    }
    assert!(found > 30);
}

#[tokio::test]
async fn a_foreign_host_name_is_turned_away_with_the_remedy() {
    let served = served(None).await;
    let answer = get_as(served.address, "/api/snapshot", "evil.example").await;
    assert!(
        answer.starts_with("HTTP/1.1 421") && answer.contains("IP address"),
        "{answer}"
    );
    assert!(
        get_as(served.address, "/api/snapshot", "sensor.local")
            .await
            .starts_with("HTTP/1.1 200")
    );
}

#[tokio::test]
async fn the_height_picture_is_404_with_words_until_there_is_one() {
    let answer = get(served(None).await.address, "/height.png").await;
    assert!(
        answer.starts_with("HTTP/1.1 404") && answer.contains("trigger a measurement"),
        "{answer}"
    );
    let answer = get(served(Some(b"PNG!".to_vec())).await.address, "/height.png").await;
    assert!(
        answer.starts_with("HTTP/1.1 200")
            && answer.contains("image/png")
            && answer.ends_with("PNG!"),
        "{answer}"
    );
}

#[tokio::test]
async fn the_snapshot_is_json_with_the_state_in_words() {
    let served = served(None).await;
    served.handle.event(Event::Started);
    let answer = get(served.address, "/api/snapshot").await;
    let body = answer.split("\r\n\r\n").nth(1).unwrap();
    let json: serde_json::Value = serde_json::from_str(body).unwrap();
    assert_eq!(
        (
            &json["state"],
            &json["result"],
            &json["counters"]["sequence"]
        ),
        (&"ready".into(), &serde_json::Value::Null, &4.into())
    );
    assert!(get(served.address, "/healthz").await.ends_with("ok\n"));
}

#[tokio::test]
async fn events_bring_the_snapshot_at_once_and_again_when_it_changes() {
    let served = served(None).await;
    let mut stream = TcpStream::connect(served.address).await.unwrap();
    stream
        .write_all(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .await
        .unwrap();
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
    let served = served(None).await;
    let mut open = Vec::new();
    for _ in 0..router::MAX_FOLLOWERS {
        let mut stream = TcpStream::connect(served.address).await.unwrap();
        stream
            .write_all(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
            .await
            .unwrap();
        let mut first = [0; 12];
        stream.read_exact(&mut first).await.unwrap();
        assert_eq!(&first, b"HTTP/1.1 200");
        open.push(stream);
    }
    assert!(
        get(served.address, "/events")
            .await
            .starts_with("HTTP/1.1 503")
    );
}

#[tokio::test]
async fn a_port_in_use_is_an_error_that_names_the_address_and_the_remedy() {
    let served = served(None).await;
    let words = bind(served.address).await.unwrap_err().to_string();
    assert!(
        words.contains(&served.address.to_string()) && words.contains("choose another port"),
        "{words}"
    );
}
