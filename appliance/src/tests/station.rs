//! A station with a recipe that cannot be used stays reachable, and loads another one.

use super::Bed;
use super::recipes::HEAD;
use crate::config::Config;
use crate::production::caught;
use crate::recipe::Store;
use crate::recipe::file::archive::pack;
use crate::service::{Caller, Daemon};
use crate::station::snapshot::status;
use crate::station::{
    ActiveRecipe, Client, ControlWrite, Effect, Event, Identity, Limits, Masked, Micros, RecipeKey,
    Request, Settings, Station, StationHandle, error_code,
};
use crate::system::progress::Progress;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::Instant;

#[test]
fn a_station_whose_recipe_cannot_be_used_stays_reachable_and_loads_another() {
    let bed = Bed::new();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fringed.toml");
    fs::write(folder.path().join("head.toml"), HEAD).unwrap();
    let text = "state = \"state\"\n[modbus]\nlisten = \"127.0.0.1:0\"\n[http]\nlisten = \"127.0.0.1:0\"\n\
                [head]\nscenario = \"head.toml\"\n";
    fs::write(&path, text).unwrap();
    let store = Store::open(&folder.path().join("state/recipes")).unwrap();
    // As somebody may have stored it in the folder: every value is within its bounds, but no head
    // can measure 9 m above the plane.
    let (mut file, arrays) = (bed.file.clone(), &bed.recipe.arrays);
    file.range_mm = [-10.0, 9000.0];
    store.save(1, &pack(&file, arrays).unwrap().0).unwrap();
    (file.number, file.range_mm) = (2, bed.file.range_mm);
    store.save(2, &pack(&file, arrays).unwrap().0).unwrap();

    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let config = Config::read(&path).unwrap();
    let daemon = Daemon::start(
        &config,
        pool.unwrap(),
        Progress::new(true),
        &Caller::default(),
    )
    .unwrap();
    let refused = daemon.wait_until_ready().unwrap_err();
    assert!(refused.to_string().contains("range"), "{refused}");
    let after = daemon.station.snapshot();
    assert_eq!(after.error_code, error_code::RECIPE_UNUSABLE);
    assert!(after.fault.is_none() && after.worker_alive && after.recipe.is_none());
    TcpStream::connect(daemon.modbus).unwrap();
    let mut page = TcpStream::connect(daemon.http).unwrap();
    let request = format!(
        "GET /healthz HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
        daemon.http
    );
    page.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    page.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");

    let online = ControlWrite {
        control: Masked::<u16>::all(crate::station::control::ONLINE),
        ..ControlWrite::default()
    };
    let write = Event::Write {
        write: online,
        rising: 0,
        client: Client::default(),
    };
    daemon.station.event(write);
    let load = Request::Load(RecipeKey::Number(2));
    daemon.station.event(Event::Request(load));
    let runtime = crate::system::runtime().unwrap();
    let ready = runtime.block_on(async {
        let mut snapshots = daemon.station.subscribe();
        let ready = snapshots.wait_for(|now| now.is(status::READY)).await;
        ready.unwrap().clone()
    });
    assert_eq!((ready.active(), ready.error_code), (Some(2), 0));
    daemon.stop();
    // Nothing is lost.
    assert_eq!(store.numbers(), [1, 2]);
}

#[test]
fn a_panic_while_a_recipe_is_loaded_becomes_error_402_of_a_station_that_loads_another() {
    let identity = Identity {
        vendor: "v".into(),
        product: "sensor".into(),
        serial: "S".into(),
        version: "1".into(),
    };
    let settings = Settings {
        next_seq: 1,
        buffered: Default::default(),
        boot_id: 1,
        teach_allowed: false,
        identity: Arc::new(identity),
        limits: Limits::default(),
    };
    // The answers of a measuring task whose planning of recipe 1 panics, with words that were
    // formatted or not.
    let answer = |effect| {
        let Effect::Load {
            job,
            key: RecipeKey::Number(number),
        } = effect
        else {
            return None;
        };
        let prepared = caught(|| match number {
            1 => panic!("index {number} of an empty list"),
            2 => panic!("explicit"),
            _ => Ok(ActiveRecipe {
                number,
                crc: 1,
                part_number: "P".into(),
                name: "part".into(),
            }),
        });
        Some(match prepared {
            Ok(recipe) => Event::RecipeLoaded { job, recipe },
            Err((result, message)) => Event::LoadFailed {
                job,
                result,
                message: message.into(),
            },
        })
    };
    let station = Station::new(settings, Micros(0));
    let handle = StationHandle::new(station, Instant::now(), answer);
    handle.event(Event::Started);
    let load = |number| handle.event(Event::Request(Request::Load(RecipeKey::Number(number))));
    for (number, said) in [(1, "(index 1 of an empty list)"), (2, "(explicit)")] {
        let after = load(number);
        assert_eq!(after.error_code, error_code::RECIPE_UNUSABLE);
        let words = after.error.as_deref().unwrap();
        assert!(
            words.contains(said) && words.contains("teach it again"),
            "{words}"
        );
        assert!(after.fault.is_none() && after.recipe.is_none());
    }
    let after = load(3);
    assert_eq!((after.active(), after.error_code), (Some(3), 0));
}
