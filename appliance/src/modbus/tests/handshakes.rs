//! Both handshakes, retries and torn accesses.

use super::*;

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
        (1, 1000, 0x0104)
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
