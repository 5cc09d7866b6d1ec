//! The daemon under a service manager: its `sd_notify` messages, its journal entries, and how it
//! ends.

use crate::station_plc::{Daemon, ONLINE, Place, Plc, READY, SMALL_HEAD, command, end_by};
use crate::written::{FRINGED, program};
use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::fs::MetadataExt as _;
use std::os::unix::net::UnixDatagram;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tests::until::{PATIENCE, until};

/// Silence that these managers treat as a hang; the daemon reports after a quarter of this time.
const WATCHDOG: Duration = Duration::from_millis(800);
/// RECIPE_LOAD of CONTROL.
const RECIPE_LOAD: u16 = 1 << 3;

/// A service manager that only receives messages.
struct Manager {
    socket: UnixDatagram,
    folder: TempDir,
}

impl Manager {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let socket = UnixDatagram::bind(folder.path().join("notify")).unwrap();
        Self { socket, folder }
    }

    /// The command that starts the daemon of a place under this manager.
    fn command(&self, place: &Place) -> Command {
        let mut command = command(place);
        command
            .env("NOTIFY_SOCKET", self.folder.path().join("notify"))
            .env("WATCHDOG_USEC", WATCHDOG.as_micros().to_string());
        command
    }

    /// The lines of the next message; `None` if none arrives in time.
    fn hear(&self, patience: Duration) -> Option<Vec<String>> {
        self.socket.set_read_timeout(Some(patience)).unwrap();
        let mut bytes = [0; 4096];
        let length = self.socket.recv(&mut bytes).ok()?;
        let text = std::str::from_utf8(&bytes[..length]).unwrap();
        Some(text.lines().map(str::to_owned).collect())
    }

    /// All lines up to the first with this beginning.
    fn hear_until(&self, beginning: &str) -> Vec<String> {
        let mut all = Vec::new();
        while !all.iter().any(|line: &String| line.starts_with(beginning)) {
            let heard = self.hear(PATIENCE);
            all.extend(heard.unwrap_or_else(|| panic!("no {beginning}: {all:?}")));
        }
        all
    }
}

/// A daemon whose output the test does not read. It is killed on drop.
struct Silent(Child);

impl Drop for Silent {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(mut command: Command) -> Silent {
    Silent(command.spawn().unwrap())
}

fn end(mut silent: Silent) -> ExitStatus {
    end_by("-TERM", &mut silent.0)
}

#[test]
fn ready_is_told_when_a_trigger_would_be_accepted_and_not_before() {
    let (place, manager) = (Place::new(), Manager::new());
    let daemon = Daemon::of(manager.command(&place));
    let start = manager.hear_until("READY=1");
    // Its first start teaches, which takes time: it reports progress to the manager.
    assert_eq!(start[0], "STATUS=starting");
    let more = format!("EXTEND_TIMEOUT_USEC={}", WATCHDOG.as_micros());
    assert!(start.contains(&more), "{start:?}");
    assert!(!start.contains(&"WATCHDOG=1".to_owned()), "{start:?}");
    let mut plc = Plc::connect(&daemon);
    assert!(plc.status().has(READY), "READY was told too early");
    assert_eq!(plc.measure(7)[8], 1);
    let status = manager.hear_until("STATUS=recipe");
    assert!(
        status.contains(&"STATUS=recipe 1 (Part 1)".to_owned()),
        "{status:?}"
    );
    assert_eq!(daemon.terminate().code(), Some(0));
    let rest = manager.hear_until("STOPPING=1");
    assert!(
        !rest.iter().any(|line| line.starts_with("EXTEND")),
        "{rest:?}"
    );
}

#[test]
fn only_the_measuring_task_feeds_the_watchdog_and_a_hung_one_still_ends_in_time() {
    let (place, manager) = (Place::taught(), Manager::new());
    let daemon = Daemon::of(manager.command(&place));
    manager.hear_until("READY=1");
    for _ in 0..5 {
        let beat = manager.hear(WATCHDOG);
        assert!(beat.is_some(), "a sign of life came too late");
    }
    // This recipe is a pipe without a writer: the measuring task, which reads recipes, waits for
    // ever.
    let recipe = place.path("state/recipes/0002.recipe");
    assert!(
        Command::new("mkfifo")
            .arg(&recipe)
            .status()
            .unwrap()
            .success()
    );
    let mut plc = Plc::connect(&daemon);
    plc.write(0, &[ONLINE]);
    plc.write(0, &[ONLINE | RECIPE_LOAD, 0, 2, 0, 0, 0, 0, 0]);
    // Messages that were sent before the read.
    while manager.hear(WATCHDOG / 2).is_some() {}
    let hung = Instant::now();
    while hung.elapsed() < 3 * WATCHDOG {
        // Everything else works.
        assert!(!plc.status().has(READY));
        if let Some(lines) = manager.hear(WATCHDOG / 8) {
            assert!(!lines.contains(&"WATCHDOG=1".to_owned()), "{lines:?}");
        }
    }
    assert_eq!(daemon.terminate().code(), Some(0));
}

#[test]
fn a_start_that_is_told_to_end_ends_cleanly() {
    // The default head: computing its light takes longer than ending the daemon.
    let (place, manager) = (Place::new(), Manager::new());
    fs::write(place.path("fringed.toml"), "state = \"state\"\n").unwrap();
    let child = start(manager.command(&place));
    manager.hear_until("EXTEND_TIMEOUT_USEC");
    assert_eq!(end(child).code(), Some(0));
    let rest = manager.hear_until("STOPPING=1");
    assert!(!rest.contains(&"READY=1".to_owned()), "{rest:?}");
    // It was stopped and not killed; the next start reports this.
    let boots = fs::read_to_string(place.path("state/boots")).unwrap();
    assert!(boots.contains("stopped"), "{boots}");
}

/// Ends the daemon of a place by Ctrl-C as soon as `reached` is true of its output and the address
/// of its page; returns its output.
fn interrupted(place: &Place, reached: &dyn Fn(&str, SocketAddr) -> bool) -> String {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let page = free.local_addr().unwrap();
    drop(free);
    let said = place.path("stderr");
    let mut command = Command::new(FRINGED);
    command
        .args(["serve", "--modbus", "127.0.0.1:0", "--http"])
        .arg(page.to_string())
        .arg("--config")
        .arg(place.path("fringed.toml"))
        .stderr(File::create(&said).unwrap());
    let mut child = start(command);
    until("moment to interrupt it", PATIENCE, || {
        let said = fs::read_to_string(&said).unwrap();
        reached(&said, page).then_some(()).ok_or(said)
    });
    assert_eq!(end_by("-INT", &mut child.0).code(), Some(0));
    fs::read_to_string(&said).unwrap()
}

#[test]
fn ctrl_c_during_the_opening_or_the_first_teaching_ends_it_in_time_and_without_a_complaint() {
    let place = Place::new();
    fs::write(
        place.path("fringed.toml"),
        "state = \"state\"\n[head]\nscenario = \"many.toml\"\n",
    )
    .unwrap();
    // Computing the light of so many rays takes longer than any stop waits.
    fs::write(place.path("many.toml"), "sub_rays = 16\n").unwrap();
    let opening = interrupted(&place, &|said, _| said.contains("shown this once"));
    fs::write(place.path("many.toml"), "sub_rays = 1\n").unwrap();
    let teaching = interrupted(&place, &|_, page| {
        let Ok(mut stream) = TcpStream::connect(page) else {
            return false;
        };
        let ask =
            format!("GET /api/snapshot HTTP/1.1\r\nHost: {page}\r\nConnection: close\r\n\r\n");
        let mut answer = String::new();
        let asked = stream.write_all(ask.as_bytes());
        asked
            .and_then(|()| stream.read_to_string(&mut answer))
            .is_ok()
            && answer.contains("\"state\":\"teaching\"")
    });
    for said in [opening, teaching] {
        let (_, after) = said.split_once("fringed: stopping\n").expect(&said);
        assert_eq!(after, "", "{said}");
    }
    assert!(!place.recipe().exists());
}

#[test]
fn a_head_that_is_not_there_at_the_start_is_a_fault_until_it_is() {
    let (place, manager) = (Place::new(), Manager::new());
    let program = program();
    fs::write(place.path("other.toml"), SMALL_HEAD.replace("160", "128")).unwrap();
    fs::write(
        place.path("other-head.toml"),
        "[head]\nscenario = \"other.toml\"\n",
    )
    .unwrap();
    for (config, recording) in [("fringed.toml", "one"), ("other-head.toml", "two")] {
        let [config, recording] =
            [config, recording].map(|name| place.path(name).display().to_string());
        program
            .run(&["record", &recording, "--config", &config])
            .succeeded();
    }
    let config =
        "state = \"state\"\n[head]\nbackend = \"replay\"\nrecordings = [\"one\", \"two\"]\n";
    fs::write(place.path("fringed.toml"), config).unwrap();
    // Without a service manager it ends with the reason.
    let mut alone = command(&place);
    assert_eq!(alone.spawn().unwrap().wait().unwrap().code(), Some(69));
    // As a service it waits; here until the recordings are of one head.
    let child = start(manager.command(&place));
    let waiting = manager.hear_until("STATUS=fault");
    assert!(!waiting.contains(&"READY=1".to_owned()), "{waiting:?}");
    manager.hear_until("EXTEND_TIMEOUT_USEC");
    fs::rename(place.path("two"), place.path("three")).unwrap();
    fs::rename(place.path("one"), place.path("two")).unwrap();
    let copied = Command::new("cp")
        .arg("-r")
        .args([place.path("two"), place.path("one")])
        .status();
    assert!(copied.unwrap().success());
    manager.hear_until("READY=1");
    let status = manager.hear_until("STATUS=");
    assert!(
        status
            .iter()
            .any(|line| line.starts_with("STATUS=no recipe")),
        "{status:?}"
    );
    assert_eq!(end(child).code(), Some(0));
}

#[test]
fn a_journal_gets_priorities_and_a_terminal_does_not() {
    let folder = tempfile::tempdir().unwrap();
    for (journal, beginning) in [(true, "<3>"), (false, "fringed: ")] {
        let stderr = File::create(folder.path().join("stderr")).unwrap();
        let about = stderr.metadata().unwrap();
        let other = u64::from(!journal);
        let mut command = Command::new(FRINGED);
        command
            .args(["--config", "no-such-file"])
            .env(
                "JOURNAL_STREAM",
                format!("{}:{}", about.dev(), about.ino() + other),
            )
            .stderr(stderr);
        assert_eq!(command.status().unwrap().code(), Some(66));
        let said = fs::read_to_string(folder.path().join("stderr")).unwrap();
        assert!(said.starts_with(beginning), "{said}");
        assert!(!said.contains("<3>fringed"), "{said}");
    }
}

#[test]
fn a_secret_that_is_given_as_a_credential_is_not_shown_and_a_weak_one_is_refused() {
    let (place, credentials) = (Place::taught(), tempfile::tempdir().unwrap());
    let file = credentials.path().join("fringed.secret");
    let with = || {
        let mut command = command(&place);
        command.env("CREDENTIALS_DIRECTORY", credentials.path());
        command
    };
    fs::write(&file, "short").unwrap();
    assert_eq!(with().spawn().unwrap().wait().unwrap().code(), Some(78));
    fs::write(&file, "K7QFM-2XW8N-4TZ0B").unwrap();
    let given = Daemon::of(with());
    assert!(!given.log.contains("shown this once"), "{}", given.log);
    drop(given);
    // Without it the device generates one as before.
    fs::remove_file(&file).unwrap();
    let made = Daemon::of(with());
    assert!(made.log.contains("shown this once"), "{}", made.log);
}
