//! The target for Modbus: the bytes of one connection to the server, with a worker that carries out
//! every effect.

use appliance::config::WordOrder;
use appliance::modbus::{Clients, Options, Refusals, serve};
use appliance::station::{
    ActiveRecipe, Effect, Event, Identity, Inspection, Job, Limits, Micros, RecipeKey, Request,
    Settings, Station, StationHandle, Verdict,
};
use appliance::system::progress::Progress;
use std::future;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{self, Runtime};
use tokio::time::timeout;

/// Longest wait for the server to answer or close.
const PATIENCE: Duration = Duration::from_secs(5);
/// After this time the server gives up an incomplete Modbus frame.
const FRAME: Duration = Duration::from_millis(200);

/// Settings of the station behind a server.
pub fn settings() -> Settings {
    let identity = Identity {
        vendor: "fringed".into(),
        product: "fringe projection sensor".into(),
        serial: "SN-1".into(),
        version: "1".into(),
    };
    Settings {
        next_seq: 1000,
        buffered: Default::default(),
        boot_id: 1,
        teach_allowed: true,
        identity: Arc::new(identity),
        limits: Limits::default(),
    }
}

/// A runtime with one thread.
pub fn runtime() -> Runtime {
    let mut builder = runtime::Builder::new_current_thread();
    builder.enable_all().build().expect("a runtime")
}

/// A station behind two servers: a lenient one, and one that swaps words and requires its unit id.
struct Plant {
    runtime: Runtime,
    addresses: [SocketAddr; 2],
    handle: StationHandle,
    orders: Receiver<Effect>,
}

thread_local! {
    static PLANT: Plant = Plant::new();
}

impl Plant {
    fn new() -> Self {
        let runtime = runtime();
        let (sink, orders) = channel();
        let station = Station::new(settings(), Micros(0));
        let handle = StationHandle::new(station, Instant::now(), move |effect| {
            let stored = match effect {
                Effect::PersistSeq(seq) => Some(Event::Stored { seq, failed: None }),
                _ => None,
            };
            // The last effect may come after the receiver was dropped.
            let _ = sink.send(effect);
            stored
        });
        let lenient = Options {
            frame: FRAME,
            ..Options::default()
        };
        let mut strict = lenient.clone();
        strict.config.word_order = WordOrder::Swapped;
        strict.config.strict_unit_id = Some(1);
        let addresses = [lenient, strict].map(|options| {
            runtime.block_on(async {
                let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
                let address = listener.local_addr().expect("an address");
                let refusals = Refusals::new(Progress::new(true));
                let clients = Clients::new(64);
                let end = future::pending();
                let served = serve(listener, handle.clone(), options, clients, refusals, end);
                tokio::spawn(served);
                address
            })
        });
        let plant = Self {
            runtime,
            addresses,
            handle,
            orders,
        };
        plant.handle.event(Event::Started);
        let load = Request::Load(RecipeKey::Number(7));
        plant.handle.event(Event::Request(load));
        plant.work();
        plant
    }

    /// Carries out all effects; returns how many parts were measured.
    fn work(&self) -> u32 {
        let mut measured = 0;
        while let Ok(order) = self.orders.try_recv() {
            match order {
                Effect::Measure(Job { job, .. }) => {
                    measured += 1;
                    self.handle.event(Event::ExposureDone { job });
                    let inspection = Inspection {
                        judged: Verdict::Pass,
                        ..Inspection::default()
                    };
                    let inspection = Arc::new(inspection);
                    self.handle.event(Event::Finished { job, inspection });
                }
                Effect::Load { job, key } => {
                    let recipe = match key {
                        RecipeKey::Number(number) => recipe(number, "P-1".into()),
                        RecipeKey::PartNumber(part_number) => recipe(3, part_number),
                    };
                    self.handle.event(Event::RecipeLoaded { job, recipe });
                }
                Effect::Teach { job, teaching } => {
                    let recipe = recipe(teaching.number, "P-1".into());
                    self.handle.event(Event::Taught { job, recipe });
                }
                _ => {}
            }
        }
        measured
    }

    /// Sends bytes in two pieces and reads until the server closes.
    async fn exchange(&self, address: SocketAddr, (one, two): (&[u8], &[u8])) -> Vec<u8> {
        let mut stream = TcpStream::connect(address).await.expect("connected");
        // The server may close before it has read all.
        let _ = stream.write_all(one).await;
        tokio::task::yield_now().await;
        let _ = stream.write_all(two).await;
        let _ = stream.shutdown().await;
        let mut answer = Vec::new();
        let read = timeout(PATIENCE, stream.read_to_end(&mut answer)).await;
        assert!(read.is_ok(), "the server neither answers nor closes");
        answer
    }
}

fn recipe(number: u16, part_number: Arc<str>) -> ActiveRecipe {
    ActiveRecipe {
        number,
        crc: 1,
        part_number,
        name: "part".into(),
    }
}

/// The bytes of one PLC. The first byte selects the server, and where the bytes are cut in two.
///
/// The server closes, answers in whole frames, and as many parts are measured as triggers were
/// counted.
pub fn modbus(data: &[u8]) {
    let Some((options, bytes)) = data.split_first() else {
        return;
    };
    PLANT.with(|plant| {
        let address = plant.addresses[usize::from(options & 1)];
        let pieces = bytes.split_at(bytes.len() * usize::from(options >> 1) / 127);
        let before = plant.handle.snapshot().triggers;
        let answer = plant.runtime.block_on(plant.exchange(address, pieces));
        let mut measured = plant.work();
        // An effect may follow from an event of the first round.
        measured += plant.work();
        let counted = plant.handle.snapshot().triggers.wrapping_sub(before);
        assert_eq!(counted, measured, "as many measurements as triggers");
        whole(&answer);
    });
}

/// Panics unless an answer consists of whole Modbus TCP frames.
fn whole(mut answer: &[u8]) {
    while !answer.is_empty() {
        let length = match answer {
            [_, _, 0, 0, high, low, ..] => usize::from(u16::from_be_bytes([*high, *low])),
            _ => panic!("no header: {answer:?}"),
        };
        assert!((2..=254).contains(&length), "{length}: {answer:?}");
        answer = answer.get(6 + length..).expect("a whole frame");
    }
}
