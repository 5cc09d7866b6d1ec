//! Connections: number, time, garbage, addresses.

use super::*;

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
    let [major, minor] = map::VERSION.to_be_bytes();
    assert_eq!(answers[7..11], [3, 2, major, minor]);
    assert_eq!(answers[11 + 7..11 + 9], [0x83, 3]);
    assert_eq!(answers[20 + 7..], [3, 2, major, minor]);
}

#[tokio::test]
async fn unit_ids_are_all_accepted_unless_one_is_configured() {
    let mut options = Options::default();
    options.config.strict_unit_id = Some(3);
    let plant = Plant::with(options, false).await;
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
        // Closed, with or without a reset for unread bytes.
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
    let plant = Plant::with_places(Options::default(), 2, false).await;
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
async fn who_may_not_write_reads_everything_and_is_refused_with_exception_1_and_a_line_in_the_log()
{
    let mut options = Options::default();
    options.config.writers = vec!["127.0.0.2/32".parse().unwrap()];
    let plant = Plant::with(options, false).await;
    let mut reader = plant.client().await;
    assert!(reader.read_input_registers(200, 120).await.unwrap().is_ok());
    for _ in 0..100 {
        assert_eq!(
            reader.write_single_register(1, 9).await.unwrap(),
            Err(Exception::IllegalFunction)
        );
    }
    assert_eq!(
        reader
            .read_write_multiple_registers(100, 32, 1, &[9])
            .await
            .unwrap(),
        Err(Exception::IllegalFunction)
    );
    assert_eq!(
        reader.write_single_coil(1, true).await.unwrap(),
        Err(Exception::IllegalFunction)
    );
    assert_eq!((plant.work(), plant.handle.snapshot().missed), (0, 0));
    let log = plant.log.latest();
    assert_eq!(log.len(), 1, "{log:?}");
    let line = log[0]["words"].as_str().unwrap();
    assert!(line.contains("127.0.0.1") && line.contains("modbus.writers"));
}

#[tokio::test]
async fn who_may_not_read_gets_no_connection() {
    let mut options = Options::default();
    options.config.readers = vec!["10.0.0.0/8".parse().unwrap()];
    let plant = Plant::with(options, false).await;
    let mut stranger = plant.client().await;
    assert!(stranger.read_input_registers(100, 1).await.is_err());
    let log = plant.log.latest();
    assert!(log[0]["words"].as_str().unwrap().contains("modbus.readers"));
}

#[tokio::test]
async fn a_mute_crowd_makes_room_for_a_client_that_speaks() {
    let plant = Plant::with_places(Options::default(), 3, false).await;
    let mut crowd = Vec::new();
    for _ in 0..3 {
        crowd.push(TcpStream::connect(plant.address).await.unwrap());
    }
    // As soon as the silent connections have been idle for long enough.
    let mut plc = loop {
        let mut plc = plant.client().await;
        if plc.read_input_registers(100, 1).await.is_ok() {
            break plc;
        }
    };
    let mut rest = Vec::new();
    assert_eq!(crowd[0].read_to_end(&mut rest).await.unwrap_or(0), 0);
    assert!(plc.read_input_registers(100, 1).await.unwrap().is_ok());
}
