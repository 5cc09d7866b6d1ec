//! The server as a PLC sees it: `tokio-modbus`' own client, and raw bytes where that client is too
//! well-behaved.

mod blocks;
mod boundaries;
mod connections;
mod exceptions;
mod frozen;
mod handshakes;
mod slots;

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio_modbus::ExceptionCode as Exception;
use tokio_modbus::client::{Context, Reader, Writer, tcp};
use tokio_modbus::slave::Slave;

use super::map::at;
use super::*;
use crate::config::WordOrder;
use crate::station::snapshot::status;
use crate::station::*;
use crate::system::journal::Logbook;
use crate::system::progress::Progress;

fn settings() -> Settings {
    let identity = Identity {
        vendor: "fringed".into(),
        product: "fringe projection sensor".into(),
        serial: "SN-0001".into(),
        version: "1.2.3".into(),
    };
    Settings {
        next_seq: 1000,
        buffered: Default::default(),
        boot_id: 0xB007_1D00,
        teach_allowed: false,
        identity: Arc::new(identity),
        limits: Limits::default(),
    }
}

/// A station behind a real server on a free port, with a worker that carries out orders when asked.
struct Plant {
    address: SocketAddr,
    handle: StationHandle,
    orders: Receiver<Effect>,
    log: Logbook,
}

impl Plant {
    async fn new() -> Self {
        Self::with(Options::default(), false).await
    }

    async fn with(options: Options, buffered: bool) -> Self {
        Self::with_places(options, 8, buffered).await
    }

    async fn with_places(options: Options, places: usize, buffered: bool) -> Self {
        let (sink, orders) = channel();
        let handle = StationHandle::new(
            Station::new(settings(), Micros(0)),
            Instant::now(),
            move |effect| {
                // The receiver is gone only in tests that have checked all they wanted.
                let _ = sink.send(effect);
                None
            },
        );
        let progress = Progress::new(true);
        let log = progress.logbook().clone();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        tokio::spawn(serve(
            listener,
            handle.clone(),
            options,
            Clients::new(places),
            Refusals::new(progress),
            std::future::pending(),
        ));
        let plant = Self {
            address,
            handle,
            orders,
            log,
        };
        plant.handle.event(Event::Started);
        plant
            .handle
            .event(Event::Request(Request::Load(RecipeKey::Number(7))));
        plant.work();
        if buffered {
            let mut edges = ConnectionEdges::default();
            let write = ControlWrite {
                control: Masked::<u16>::all(0x41),
                ..Default::default()
            };
            plant.handle.write(&mut edges, write).unwrap();
        }
        plant
    }

    /// Carries out every order; answers with the number of measurements.
    fn work(&self) -> usize {
        let mut measured = 0;
        while let Ok(order) = self.orders.try_recv() {
            match order {
                Effect::Measure(Job { job, .. }) => {
                    measured += 1;
                    self.handle.event(Event::ExposureDone { job });
                    self.handle.event(Event::Finished {
                        job,
                        inspection: Arc::new(inspection()),
                    });
                }
                Effect::Load {
                    job,
                    key: RecipeKey::Number(number),
                } => {
                    let recipe = ActiveRecipe {
                        number,
                        crc: 0xCAFE_F00D,
                        part_number: "BRACKET".into(),
                        name: "bracket".into(),
                    };
                    self.handle.event(Event::RecipeLoaded { job, recipe });
                }
                _ => {}
            }
        }
        measured
    }

    async fn client(&self) -> Context {
        tcp::connect(self.address).await.unwrap()
    }
}

fn inspection() -> Inspection {
    let limits = (Some(-0.2), Some(0.2));
    let gauges = [
        GaugeValue::judged(
            1,
            "dome",
            Unit::Length,
            Measured {
                systematic: 0.0005,
                expected: Some(0.03),
                ..Measured::new(Some(0.12345), Some(0.001))
            },
            limits,
        ),
        GaugeValue::judged(
            2,
            "flange",
            Unit::Angle,
            Measured::new(Some(-0.5), Some(0.01)),
            limits,
        ),
    ];
    let mut stages = Stages::default();
    for (stage, us) in [
        (Stage::Alignment, 200),
        (Stage::Strips, 1_500),
        (Stage::Judgement, 40),
    ] {
        stages.add(stage, us);
    }
    Inspection {
        stages,
        judged: Verdict::Fail,
        gauges: gauges.into_iter().collect(),
        valid_points: 123_456,
        coverage_permille: 987,
        temperature_c: Some(31.4),
        height_noise_mm: 0.0123,
        fitness_permille: 1000,
        flags: result::flag::SIMULATED,
        ..Default::default()
    }
}

/// Sends one raw request PDU and answers with the response PDU.
async fn raw(stream: &mut TcpStream, pdu: &[u8]) -> Vec<u8> {
    let length = u16::try_from(pdu.len() + 1).unwrap().to_be_bytes();
    let mut frame = vec![0x12, 0x34, 0, 0, length[0], length[1], 9];
    frame.extend_from_slice(pdu);
    stream.write_all(&frame).await.unwrap();
    let mut head = [0; 7];
    stream.read_exact(&mut head).await.unwrap();
    assert_eq!(
        (&head[..4], head[6]),
        (&[0x12, 0x34, 0, 0][..], 9),
        "transaction and unit are echoed"
    );
    let mut answer = vec![0; usize::from(u16::from_be_bytes([head[4], head[5]])) - 1];
    stream.read_exact(&mut answer).await.unwrap();
    answer
}

fn u32_at(words: &[u16], k: usize) -> u32 {
    u32::from(words[k]) << 16 | u32::from(words[k + 1])
}
