//! The server as a PLC sees it: `tokio-modbus`' own client, and raw bytes where that client is too well-behaved.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_modbus::ExceptionCode as Exception;
use tokio_modbus::client::{Context, Reader, Writer, tcp};
use tokio_modbus::slave::Slave;

use super::map::at;
use super::*;
use crate::station::snapshot::status;
use crate::station::*;

/// A station behind a real server on a free port, with a worker that works when told to.
struct Plant {
    address: SocketAddr,
    handle: StationHandle,
    orders: Receiver<Effect>,
}

impl Plant {
    async fn new() -> Self {
        Self::with(Options::default(), false).await
    }

    async fn with(options: Options, buffered: bool) -> Self {
        let identity = Identity {
            vendor: "fringed".into(),
            product: "fringe projection sensor".into(),
            serial: "SN-0001".into(),
            version: "1.2.3".into(),
        };
        let settings = Settings {
            next_seq: 1000,
            boot_id: 0xB007_1D00,
            teach_allowed: false,
            identity: Arc::new(identity),
            limits: Limits::default(),
        };
        let (sink, orders) = channel();
        let handle = StationHandle::new(
            Station::new(settings, Micros(0)),
            Instant::now(),
            move |effect| {
                // The plant outlives its station's last effect only in tests that have looked at what they wanted.
                let _ = sink.send(effect);
            },
        );
        let listener = bind("127.0.0.1:0".parse().unwrap()).await.unwrap();
        let address = listener.local_addr().unwrap();
        tokio::spawn(serve(
            listener,
            handle.clone(),
            options,
            std::future::pending(),
        ));
        let plant = Self {
            address,
            handle,
            orders,
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
        GaugeValue::judged("dome", Unit::Length, Some(0.12345), Some(0.001), limits),
        GaugeValue::judged("flange", Unit::Angle, Some(-0.5), Some(0.01), limits),
    ];
    Inspection {
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

#[tokio::test]
async fn the_edge_handshake_measures_once_and_one_read_holds_the_result() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    plc.write_single_register(0, 1).await.unwrap().unwrap();
    let before = plc.read_input_registers(100, 32).await.unwrap().unwrap();
    assert_eq!(before[0] & status::READY, status::READY);
    plc.write_multiple_registers(0, &[3, 0, 0, 1, 0, 77, 1, 2])
        .await
        .unwrap()
        .unwrap();
    let busy = plc.read_holding_registers(100, 1).await.unwrap().unwrap();
    assert_eq!(
        busy[0] & (status::TRIGGER_ACK | status::BUSY | status::READY),
        status::TRIGGER_ACK | status::BUSY
    );
    plc.write_single_register(0, 1).await.unwrap().unwrap();
    assert_eq!(plant.work(), 1);
    let after = plc.read_input_registers(100, 32).await.unwrap().unwrap();
    assert_eq!(
        (after[0] ^ before[0]) & status::RESULT_TOGGLE,
        status::RESULT_TOGGLE
    );
    assert_eq!(
        (u32_at(&after, 10), u32_at(&after, 12), after[21]),
        (1, 1000, 0x0100)
    );
    let result = plc.read_input_registers(200, 120).await.unwrap().unwrap();
    assert_eq!((u32_at(&result, 0), u32_at(&result, 118)), (1000, 1000));
    assert_eq!(
        (result[2], result[3], u32_at(&result, 4)),
        (0, 7, 0xCAFE_F00D)
    );
    assert_eq!((u32_at(&result, 6), u32_at(&result, 28)), (77, 0x0001_0002));
    assert_eq!(
        (
            result[8],
            u32_at(&result, 10),
            u32_at(&result, 12),
            result[27]
        ),
        (2, 1, 3, 2)
    );
    assert_eq!(
        (u32_at(&result, 22), result[24], result[25], result[26]),
        (123_456, 987, 314, 123)
    );
    assert_eq!(
        (
            u32_at(&result, 32),
            u32_at(&result, 34),
            u32_at(&result, 36)
        ),
        (1235, (-5000_i32).cast_unsigned(), 0x8000_0000)
    );
    assert_eq!(
        (f32::from_bits(u32_at(&result, 64)), u32_at(&result, 68)),
        (0.12345, 0x7FC0_0000)
    );
    assert_eq!((result[96], result[97], result[98]), (0b00011, 0b00110, 0));
    plc.write_single_register(0, 5).await.unwrap().unwrap();
    assert!(!plant.handle.snapshot().is(status::RESULT_VALID));
}

#[tokio::test]
async fn the_token_handshake_survives_retries_on_new_connections() {
    let plant = Plant::new().await;
    for retry in 0..3 {
        let mut plc = plant.client().await;
        plc.write_multiple_registers(1, &[42, 0, 0, 0, 5, 0, 6])
            .await
            .unwrap()
            .unwrap();
        assert_eq!(plant.work(), usize::from(retry == 0), "retry {retry}");
    }
    let mut plc = plant.client().await;
    let result = plc.read_holding_registers(200, 120).await.unwrap().unwrap();
    assert_eq!(
        (result[2], u32_at(&result, 6), u32_at(&result, 28)),
        (42, 5, 6)
    );
    assert_eq!(
        plc.read_holding_registers(116, 1).await.unwrap().unwrap(),
        [42]
    );
}

#[tokio::test]
async fn a_stuck_trigger_bit_of_an_old_session_does_not_fire() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    plc.write_single_register(0, 3).await.unwrap().unwrap();
    assert_eq!(plant.work(), 0, "the first write is the reference level");
    plc.write_single_register(0, 1).await.unwrap().unwrap();
    plc.write_single_register(0, 3).await.unwrap().unwrap();
    assert_eq!(plant.work(), 1);
    let mut other = plant.client().await;
    other.write_single_register(0, 3).await.unwrap().unwrap();
    assert_eq!(plant.work(), 0);
}

#[tokio::test]
async fn fc23_reads_the_snapshot_after_its_own_write() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    let words = plc
        .read_write_multiple_registers(100, 32, 1, &[9])
        .await
        .unwrap()
        .unwrap();
    assert_eq!((words[4], words[16], u32_at(&words, 10)), (2, 9, 1));
    let refused = plc
        .read_write_multiple_registers(131, 2, 1, &[10])
        .await
        .unwrap();
    assert_eq!(refused, Err(Exception::IllegalDataAddress));
    assert_eq!(plant.work(), 1, "a refused read writes nothing");
    assert_eq!(plant.handle.snapshot().missed, 0);
}

#[tokio::test]
async fn two_torn_reads_show_by_the_two_sequence_numbers() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    let mut other = plant.client().await;
    plc.write_single_register(1, 1).await.unwrap().unwrap();
    plant.work();
    let first = plc.read_input_registers(200, 60).await.unwrap().unwrap();
    other.write_single_register(1, 2).await.unwrap().unwrap();
    plant.work();
    let second = plc.read_input_registers(260, 60).await.unwrap().unwrap();
    assert_eq!((u32_at(&first, 0), u32_at(&second, 58)), (1000, 1001));
}

#[tokio::test]
async fn fields_written_in_pieces_are_latched_as_they_stand_at_the_trigger() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    plc.write_single_register(4, 0x1111).await.unwrap().unwrap();
    plc.write_single_register(5, 0x2222).await.unwrap().unwrap();
    assert_eq!(
        plc.read_holding_registers(4, 2).await.unwrap().unwrap(),
        [0x1111, 0x2222],
        "reads back what was written"
    );
    plc.write_single_register(1, 1).await.unwrap().unwrap();
    plc.write_multiple_registers(4, &[9, 9])
        .await
        .unwrap()
        .unwrap();
    plant.work();
    assert_eq!(
        plc.read_input_registers(206, 2).await.unwrap().unwrap(),
        [0x1111, 0x2222]
    );
}

#[tokio::test]
async fn the_oldest_buffered_result_is_at_400_until_it_is_acknowledged() {
    let plant = Plant::with(Options::default(), true).await;
    let mut plc = plant.client().await;
    plc.write_single_register(0, 0x41).await.unwrap().unwrap();
    for token in [5, 6] {
        plc.write_single_register(1, token).await.unwrap().unwrap();
        plant.work();
    }
    for _ in 0..2 {
        let oldest = plc.read_input_registers(400, 120).await.unwrap().unwrap();
        assert_eq!(
            (oldest[2], u32_at(&oldest, 118)),
            (5, 1000),
            "reads have no side effects"
        );
    }
    plc.write_single_register(0, 0x45).await.unwrap().unwrap();
    assert_eq!(
        plc.read_input_registers(402, 1).await.unwrap().unwrap(),
        [6]
    );
    assert_eq!(
        plc.read_input_registers(117, 1).await.unwrap().unwrap(),
        [1]
    );
}

#[tokio::test]
async fn word_order_swapped_swaps_reads_and_writes() {
    let options = Options {
        word_order: WordOrder::Swapped,
        ..Default::default()
    };
    let plant = Plant::with(options, false).await;
    let mut plc = plant.client().await;
    assert_eq!(
        plc.read_input_registers(936, 4).await.unwrap().unwrap(),
        [0x5678, 0x1234, 0xE979, 0x42F6]
    );
    assert_eq!(
        plc.read_input_registers(900, 2).await.unwrap().unwrap(),
        [0x4E47, 0x4652]
    );
    plc.write_multiple_registers(4, &[0x2222, 0x1111])
        .await
        .unwrap()
        .unwrap();
    assert_eq!(plant.handle.snapshot().control.part_id, 0x1111_2222);
}

#[tokio::test]
async fn identity_and_control_read_as_in_the_map() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    let words = plc.read_holding_registers(900, 40).await.unwrap().unwrap();
    assert_eq!(
        (
            u32_at(&words, 0),
            u32_at(&words, 36),
            f32::from_bits(u32_at(&words, 38))
        ),
        (0x4652_4E47, 0x1234_5678, 123.456)
    );
    assert_eq!(
        (words[2], words[4], words[5], words[18]),
        (0x534E, 0x3030, 0x3100, 0x312E)
    );
    assert_eq!(
        plc.read_input_registers(0, 32).await.unwrap().unwrap()[0],
        1,
        "CONTROL starts with ONLINE"
    );
}

#[tokio::test]
async fn before_the_first_result_nothing_reads_as_measured() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    for block in [200, 400] {
        let words = plc.read_input_registers(block, 120).await.unwrap().unwrap();
        assert_eq!(
            (u32_at(&words, 0), words[8], words[27], u32_at(&words, 10)),
            (0, 0, 0, 0)
        );
        assert_eq!(
            (u32_at(&words, 32), u32_at(&words, 64), words[25]),
            (0x8000_0000, 0x7FC0_0000, 0x8000)
        );
        assert_eq!(words[112..118], [0; 6], "reserved registers read 0");
    }
}

#[tokio::test]
async fn coils_and_discrete_inputs_mirror_control_and_status() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    assert_eq!(
        plc.read_coils(0, 16)
            .await
            .unwrap()
            .unwrap()
            .iter()
            .position(|&set| set),
        Some(0)
    );
    let inputs = plc.read_discrete_inputs(0, 16).await.unwrap().unwrap();
    assert!(inputs[0] && inputs[1] && inputs[9] && !inputs[2]);
    plc.write_single_coil(1, false).await.unwrap().unwrap();
    plc.write_single_coil(1, true).await.unwrap().unwrap();
    assert_eq!(plant.work(), 1);
    assert_eq!(
        plc.read_holding_registers(0, 1).await.unwrap().unwrap(),
        [3]
    );
    plc.write_multiple_coils(0, &[true, false, true])
        .await
        .unwrap()
        .unwrap();
    assert_eq!(plant.handle.snapshot().control.control, 5);
    assert_eq!(
        plc.write_single_coil(8, true).await.unwrap(),
        Err(Exception::IllegalDataValue)
    );
    assert_eq!(
        plc.write_single_coil(16, true).await.unwrap(),
        Err(Exception::IllegalDataAddress)
    );
    assert_eq!(
        plc.read_coils(10, 7).await.unwrap(),
        Err(Exception::IllegalDataAddress)
    );
    assert_eq!(
        plc.read_discrete_inputs(0, 0).await.unwrap(),
        Err(Exception::IllegalDataValue)
    );
}

#[tokio::test]
async fn what_cannot_be_is_an_exception_and_the_connection_lives_on() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    for (address, count) in [
        (32, 1),
        (99, 1),
        (131, 2),
        (319, 2),
        (520, 2),
        (600, 1),
        (700, 1),
        (940, 1),
        (65535, 2),
    ] {
        assert_eq!(
            plc.read_holding_registers(address, count).await.unwrap(),
            Err(Exception::IllegalDataAddress),
            "{address}"
        );
    }
    for count in [0, 126, 65535] {
        assert_eq!(
            plc.read_input_registers(200, count).await.unwrap(),
            Err(Exception::IllegalDataValue),
            "{count}"
        );
    }
    for address in [100, 200, 319, 400, 900, 32, 65535] {
        assert_eq!(
            plc.write_single_register(address, 1).await.unwrap(),
            Err(Exception::IllegalDataAddress),
            "{address}"
        );
    }
    assert_eq!(
        plc.write_multiple_registers(31, &[0, 0]).await.unwrap(),
        Err(Exception::IllegalDataAddress)
    );
    for (address, word) in [(0, 0x0101), (0, 0x8001), (2, 10_000), (24, 1)] {
        assert_eq!(
            plc.write_single_register(address, word).await.unwrap(),
            Err(Exception::IllegalDataValue),
            "{address}"
        );
    }
    plc.write_multiple_registers(1, &[8, 10_000])
        .await
        .unwrap()
        .unwrap_err();
    let snapshot = plant.handle.snapshot();
    assert_eq!(
        (snapshot.triggers, snapshot.missed, snapshot.control),
        (0, 0, ControlRegisters::default()),
        "a refused write is refused whole"
    );
    assert!(plc.read_input_registers(200, 120).await.unwrap().is_ok());
}

#[tokio::test]
async fn requests_that_contradict_themselves_get_an_exception_too() {
    let plant = Plant::new().await;
    let mut stream = TcpStream::connect(plant.address).await.unwrap();
    let cases: [(&[u8], [u8; 2]); 12] = [
        (&[3, 0, 100, 0], [0x83, 3]),
        (&[3, 0, 100, 0, 1, 7], [0x83, 3]),
        (&[5, 0, 1, 0x12, 0x34], [0x85, 3]),
        (&[15, 0, 0, 0xFF, 0xFF, 1, 1], [0x8F, 3]),
        (&[15, 0, 0, 0, 0, 0], [0x8F, 3]),
        (&[16, 0, 1, 0x80, 1, 2, 0, 9], [0x90, 3]),
        (&[16, 0, 1, 0, 2, 2, 0, 9], [0x90, 3]),
        (&[23, 0, 100, 0, 1, 0, 1, 0, 2, 2, 0, 9], [0x97, 3]),
        (&[17], [0x91, 1]),
        (&[22, 0, 0, 0, 0, 0, 1], [0x96, 1]),
        (&[43, 13, 0], [0xAB, 1]),
        (&[0x41, 1, 2, 3], [0xC1, 1]),
    ];
    for (request, exception) in cases {
        assert_eq!(raw(&mut stream, request).await, exception, "{request:?}");
    }
    assert_eq!(plant.work(), 0);
    assert_eq!(raw(&mut stream, &[3, 0, 104, 0, 1]).await, [3, 2, 0, 1]);
}

#[tokio::test]
async fn pipelined_requests_are_answered_one_by_one_each_with_its_own_flaw() {
    let plant = Plant::new().await;
    let mut stream = TcpStream::connect(plant.address).await.unwrap();
    let good = [0, 1, 0, 0, 0, 6, 1, 3, 0, 121, 0, 1];
    let bad = [0, 2, 0, 0, 0, 5, 1, 3, 0, 121, 0];
    stream
        .write_all(&[&good[..], &bad[..], &good[..]].concat())
        .await
        .unwrap();
    let mut answers = [0; 11 + 9 + 11];
    stream.read_exact(&mut answers).await.unwrap();
    assert_eq!(answers[7..11], [3, 2, 1, 0]);
    assert_eq!(answers[11 + 7..11 + 9], [0x83, 3]);
    assert_eq!(answers[20 + 7..], [3, 2, 1, 0]);
}

#[tokio::test]
async fn device_identification_names_vendor_product_version_and_serial() {
    let plant = Plant::new().await;
    let mut stream = TcpStream::connect(plant.address).await.unwrap();
    let basic = raw(&mut stream, &[43, 14, 1, 0]).await;
    assert_eq!(basic[..7], [43, 14, 1, 0x83, 0, 0, 3]);
    assert_eq!(basic[7..16], *b"\x00\x07fringed");
    let serial = raw(&mut stream, &[43, 14, 4, 0x80]).await;
    assert_eq!(serial, *b"\x2b\x0e\x04\x83\x00\x00\x01\x80\x07SN-0001");
    assert_eq!(raw(&mut stream, &[43, 14, 4, 9]).await, [0xAB, 2]);
    assert_eq!(raw(&mut stream, &[43, 14, 3, 0]).await[6], 5);
}

#[tokio::test]
async fn unit_ids_are_all_accepted_unless_one_is_configured() {
    let plant = Plant::with(
        Options {
            strict_unit_id: Some(3),
            ..Default::default()
        },
        false,
    )
    .await;
    let mut right = tcp::connect_slave(plant.address, Slave(3)).await.unwrap();
    assert!(right.read_input_registers(100, 1).await.unwrap().is_ok());
    let mut wrong = tcp::connect_slave(plant.address, Slave(4)).await.unwrap();
    assert_eq!(
        wrong.read_input_registers(100, 1).await.unwrap(),
        Err(Exception::GatewayTargetDevice)
    );
}

#[tokio::test]
async fn garbage_closes_its_own_connection_and_disturbs_nobody() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    for garbage in [
        &b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"[..],
        &[0, 0, 0, 0, 0, 1, 1],
        &[0, 0, 0, 0, 2, 0, 1, 3],
        &[0, 0, 0, 0, 0, 2, 1, 0x83],
    ] {
        let mut stream = TcpStream::connect(plant.address).await.unwrap();
        stream.write_all(garbage).await.unwrap();
        let mut answer = Vec::new();
        // Closed, with or without a reset for what was left unread.
        let _ = stream.read_to_end(&mut answer).await;
        assert!(
            answer.is_empty(),
            "{garbage:?} was answered with {answer:?}"
        );
        assert!(plc.read_input_registers(200, 120).await.unwrap().is_ok());
    }
}

#[tokio::test]
async fn idle_connections_and_unfinished_frames_are_closed_in_time() {
    let options = Options {
        idle: Duration::from_millis(40),
        frame: Duration::from_millis(20),
        ..Default::default()
    };
    let plant = Plant::with(options, false).await;
    for start in [&[][..], &[0, 1, 0], &[0, 1, 0, 0, 0, 6, 1, 3]] {
        let mut stream = TcpStream::connect(plant.address).await.unwrap();
        stream.write_all(start).await.unwrap();
        let mut answer = Vec::new();
        assert_eq!(stream.read_to_end(&mut answer).await.unwrap_or(0), 0);
    }
}

#[tokio::test]
async fn the_connection_over_the_limit_is_closed_and_a_freed_place_is_taken_again() {
    let plant = Plant::with(
        Options {
            connections: 2,
            ..Default::default()
        },
        false,
    )
    .await;
    let mut first = plant.client().await;
    let mut second = plant.client().await;
    for plc in [&mut first, &mut second] {
        assert!(plc.read_input_registers(100, 1).await.unwrap().is_ok());
    }
    let mut third = plant.client().await;
    assert!(third.read_input_registers(100, 1).await.is_err());
    drop(first);
    // The place is free as soon as the server has seen the end of the first connection.
    loop {
        let mut next = plant.client().await;
        if let Ok(answer) = next.read_input_registers(100, 1).await {
            assert!(answer.is_ok());
            break;
        }
    }
    assert!(second.read_input_registers(100, 1).await.unwrap().is_ok());
}

#[tokio::test]
async fn a_port_in_use_is_an_error_that_names_the_address_and_the_remedy() {
    let plant = Plant::new().await;
    let error = bind(plant.address).await.unwrap_err();
    assert!(matches!(error, ModbusError::InUse { .. }));
    let words = error.to_string();
    assert!(
        words.contains(&plant.address.to_string()) && words.contains("choose another port"),
        "{words}"
    );
}

#[tokio::test]
async fn status_bits_are_where_the_map_says() {
    let plant = Plant::new().await;
    plant.handle.event(Event::Condition(Condition {
        warming_up: true,
        calibration_valid: true,
        warnings: 0x10,
    }));
    let mut plc = plant.client().await;
    let words = plc
        .read_input_registers(at::status::STATUS, 32)
        .await
        .unwrap()
        .unwrap();
    // ONLINE, READY, RECIPE_OK, WARNING, WARMING_UP, CALIBRATION_VALID; warnings clock_unsynced and low_light.
    assert_eq!(
        (words[0], words[3], words[4], words[5]),
        (0xC603, 0x18, 1, 7)
    );
    assert_eq!(
        (u32_at(&words, 6), u32_at(&words, 22)),
        (0xCAFE_F00D, 0xB007_1D00)
    );
}
