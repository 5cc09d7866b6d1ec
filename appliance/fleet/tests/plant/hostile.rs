//! Heads that answer what no head answers.

use super::impostor::{Impostor, Pieces};
use super::program::*;
use std::iter::repeat_n;
use std::path::Path;
use std::sync::atomic::Ordering;

const HEAD: &str = "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n";
const HEADER: &str = r#"{"serial":"EVIL","history":"h","first":1,"last":9}"#;

/// A line of a result.
fn line(serial: &str, seq: u32, coverage: &str) -> String {
    format!(
        "{{\"serial\":\"{serial}\",\"history\":\"h\",\"seq\":{seq},\"at_unix_ms\":null,\"clock\":\"none\",\"recipe\":1,\
         \"fingerprint\":\"0\",\"part_id\":0,\"press_stroke\":0,\"verdict\":\"PASS\",\"error_code\":0,\"flags\":0,\
         \"exposure_us\":0,\"processing_us\":0,\"coverage\":{coverage},\"placement\":null,\"gauges\":[]}}\n"
    )
}

fn text(words: &str) -> Pieces {
    Box::new([words.as_bytes().to_vec()].into_iter())
}

/// What is sent for each path, and what the log must say about it.
const KINDS: [(&str, &str); 12] = [
    ("/line", "a line is longer than 65536 bytes"),
    ("/endless", "it sends result 10, behind the last"),
    ("/many", "it sends more than the 10000 results"),
    ("/row", "wrong serial: \"GOOD\" answers"),
    ("/same", "serial \"SIM00001\" is that of"),
    ("/changes", "wrong serial: \"SECOND\" answers"),
    ("/falls", "SEQ falls from 5 to 4"),
    ("/nan", "a line is no result"),
    (
        "/redirect",
        "redirects to \"http://example.com/\", which is refused",
    ),
    ("/cut", "in the middle of a line"),
    ("/status", "it answers 500: out of order"),
    ("/garbage", "the answer breaks off"),
];

fn answers(path: &str, before: usize) -> Pieces {
    let below = |header: &str, rows: &str| {
        let body = format!("{header}\n{rows}");
        let length = body.len();
        let head = HEAD.replace("\r\n\r\n", &format!("\r\nContent-Length: {length}\r\n\r\n"));
        text(&(head + &body))
    };
    let kind = path.split("/api/").next().unwrap();
    match kind {
        "/line" => {
            let begin = format!("{HEAD}{HEADER}\n").into_bytes();
            Box::new(
                [begin]
                    .into_iter()
                    .chain(repeat_n(vec![b'1'; 1 << 20], 1024)),
            )
        }
        "/endless" => {
            let begin = format!("{HEAD}{HEADER}\n").into_bytes();
            let rows = (1..).map(|seq| line("EVIL", seq, "1").into_bytes());
            Box::new([begin].into_iter().chain(rows))
        }
        "/many" => {
            let begin = format!(
                "{HEAD}{}\n",
                HEADER.replace("\"last\":9", "\"last\":99999999")
            );
            let rows = (1..).map(|seq| line("EVIL", seq, "1").into_bytes());
            Box::new([begin.into_bytes()].into_iter().chain(rows))
        }
        "/row" => below(HEADER, &line("GOOD", 1, "1")),
        "/same" => below(&HEADER.replace("EVIL", "SIM00001"), ""),
        "/changes" if before.is_multiple_of(2) => below(&HEADER.replace("EVIL", "FIRST"), ""),
        "/changes" => below(&HEADER.replace("EVIL", "SECOND"), ""),
        "/falls" => below(HEADER, &(line("EVIL", 5, "1") + &line("EVIL", 4, "1"))),
        "/nan" => below(HEADER, &line("EVIL", 1, "NaN")),
        "/redirect" => text(
            "HTTP/1.1 307 Elsewhere\r\nLocation: http://example.com/\r\nContent-Length: 0\r\n\r\n",
        ),
        "/cut" => below(HEADER, &line("EVIL", 1, "1")[..50]),
        "/status" => text("HTTP/1.1 500 Wrong\r\nContent-Length: 12\r\n\r\nout of order"),
        "/garbage" => text("SSH-2.0-OpenSSH\r\n\r\n"),
        _ if !path.contains("after=0&") => below(HEADER, ""),
        _ => below(HEADER, &line("EVIL", 1, "1")),
    }
}

#[test]
fn a_hostile_head_is_named_and_the_others_are_collected_on() {
    let plant = Plant::of(2, &["--rate", "10", "--results", "30"]);
    for (kind, words) in KINDS {
        let impostor = Impostor::new(answers, false);
        let url = format!("http://localhost:{}{kind}", impostor.port);
        // The others are asked first.
        let place = Place::new(&[&plant.heads(), &url], "");
        let collector = place.collect(&place.store(), &[]);
        wait(kind, || {
            let log = place.log();
            log.lines()
                .any(|line| line.contains(&url) && line.contains(words))
        });
        wait("the other heads", || {
            counted(&place)
                .iter()
                .filter(|head| **head == (head.0.clone(), 30))
                .count()
                == 2
        });
        assert_eq!(collector.terminate(), Some(0), "{kind}");
        let sent = impostor.sent.load(Ordering::Relaxed);
        assert!(sent < 32 << 20, "{kind}: {sent} bytes were read");
        let reached = numbers(&place, "SELECT url, reachable FROM head ORDER BY reachable");
        assert_eq!(reached[0], (url, 0), "{kind}");
    }
}

/// A head that once claims the last of all numbers, and whose storage is an older copy from then on.
fn restored(path: &str, _: usize) -> Pieces {
    let head = |last: u32, rows: &str| {
        let header = HEADER.replace("\"last\":9", &format!("\"last\":{last}"));
        text(&format!("{HEAD}{header}\n{rows}"))
    };
    if path.contains("after=0&") {
        return head(u32::MAX, &line("EVIL", u32::MAX, "1"));
    }
    match path.contains("after=3&") {
        true => head(5, &(line("EVIL", 4, "1") + &line("EVIL", 5, "1"))),
        false if path.contains("after=4294967295&") => head(3, ""),
        false => head(5, ""),
    }
}

#[test]
fn numbers_that_went_back_begin_another_life_of_a_history_and_what_is_skipped_is_recorded() {
    let impostor = Impostor::new(restored, false);
    let url = format!("http://localhost:{}/one", impostor.port);
    let place = Place::new(&[&url], "");
    for times in 1..=2 {
        // A second collector goes on where the first ended.
        let collector = place.collect(&place.store(), &[]);
        wait("a collector", || {
            place.log().matches("1 heads are asked").count() == times
        });
        wait("both lives", || counted(&place) == [("EVIL".into(), 3)]);
        assert_eq!(collector.terminate(), Some(0));
        let seqs = "SELECT history || ' ' || seq, 0 FROM result ORDER BY history, seq";
        let found = numbers(&place, seqs).into_iter().map(|(name, _)| name);
        assert!(
            found.eq(["h 4294967295", "h.2 4", "h.2 5"]),
            "{}",
            place.log()
        );
        let gaps = numbers(&place, "SELECT history || ' ' || first, last FROM gap");
        assert_eq!(gaps, [("h.2 1".into(), 3)]);
    }
    let log = place.log();
    let named = log.matches("SEQ went back from 4294967295 to 3").count();
    assert_eq!(named, 1, "{log}");
}

#[test]
fn a_connection_to_another_host_is_refused_and_one_to_the_right_one_is_not() {
    let impostor = Impostor::new(answers, true);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/plant/certificates");
    let ca = format!("ca = {:?}", folder.join("ca.pem"));
    let [right, wrong] =
        ["localhost", "127.0.0.1"].map(|host| format!("https://{host}:{}/one", impostor.port));
    let place = Place::new(&[&right, &wrong], &ca);
    let _collector = place.collect(&place.store(), &[]);
    wait("the right host", || counted(&place) == [("EVIL".into(), 1)]);
    wait("the wrong host", || {
        let log = place.log();
        let mut lines = log.lines().filter(|line| line.contains(&wrong));
        lines.any(|line| line.contains("its certificate is for another name"))
    });
    let reached = numbers(&place, "SELECT url, reachable FROM head ORDER BY reachable");
    assert_eq!(reached.last().unwrap(), &(right, 1));
}
