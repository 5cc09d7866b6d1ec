//! What the blocks show.

use super::*;

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
    let mut options = Options::default();
    options.config.word_order = WordOrder::Swapped;
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
        plc.write_single_coil(9, true).await.unwrap(),
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
    // ONLINE, READY, RECIPE_OK, WARNING, WARMING_UP, CALIBRATION_VALID; warnings clock_unsynced and
    // low_light.
    assert_eq!(
        (words[0], words[3], words[4], words[5]),
        (0xC603, 0x18, 1, 7)
    );
    assert_eq!(
        (u32_at(&words, 6), u32_at(&words, 22)),
        (0xCAFE_F00D, 0xB007_1D00)
    );
}

#[tokio::test]
async fn gauge_detail_has_sigma_and_unit_of_the_result_beside_it() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    let before = plc.read_input_registers(520, 64).await.unwrap().unwrap();
    assert_eq!((u32_at(&before, 0), u32_at(&before, 2)), (0, 0x7FC0_0000));
    plc.write_single_register(1, 1).await.unwrap().unwrap();
    plant.work();
    let words = plc.read_input_registers(520, 64).await.unwrap().unwrap();
    assert_eq!((u32_at(&words, 0), u32_at(&words, 62)), (1000, 1000));
    let sigma = |k: usize| f32::from_bits(u32_at(&words, 2 + 2 * k));
    assert_eq!((sigma(0), sigma(1)), (0.001, 0.01));
    assert!(sigma(2).is_nan() && sigma(15).is_nan());
    assert_eq!(words[34..38], [1, 2, 0, 0]);
    assert_eq!(words[50..62], [0; 12], "reserved registers read 0");
}

#[tokio::test]
async fn gauge_uncertainty_has_the_expanded_uncertainty_and_what_good_parts_read() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    plc.write_single_register(1, 1).await.unwrap().unwrap();
    plant.work();
    let words = plc.read_input_registers(1000, 70).await.unwrap().unwrap();
    assert_eq!((u32_at(&words, 0), u32_at(&words, 66)), (1000, 1000));
    let float = |at: usize| f32::from_bits(u32_at(&words, at));
    let expanded = 2.0 * 0.001_f64.hypot(0.0005);
    assert_eq!((float(2), float(4)), (expanded as f32, 0.02));
    assert_eq!(float(34), 0.03);
    assert!(float(6).is_nan() && float(36).is_nan());
    assert!(plc.read_input_registers(1070, 1).await.unwrap().is_err());
}

#[tokio::test]
async fn health_says_what_is_known_and_what_is_not() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    let unknown = plc.read_input_registers(600, 40).await.unwrap().unwrap();
    assert_eq!(
        unknown[22..28],
        [0xFFFF, 0xFFFF, 0xFFFF, 0x8000, 0x8000, 0x8000]
    );
    assert_eq!(unknown[30..38], [0xFFFF; 8]);
    plant.handle.event(Event::Surveyed(System {
        cpu_percent: Some(37),
        free_memory_mib: Some(1234),
        free_storage_mib: Some(1 << 30),
        cpu_temperature_c: Some(51.24),
        power: Some(Power::of(0x5_0004, None)),
        kernel: Some([6, 12]),
        libcamera: Some([0, 7]),
        boots: 0x1_0002,
        unclean_boots: 3,
        watchdog_restarts: 1,
        clients: 2,
        writer_connected: true,
        recipes: [1, 2, 17, 1024, 1025].into(),
    }));
    let pace = Pace {
        camera_centihertz: 2000,
        refresh_millihertz: 60_000,
        lag_us: 12,
        dropped: 2,
        missed_flips: 1,
        retaken: 3,
        sync_error_us: 7,
    };
    plant.handle.event(Event::Paced(pace));
    plant.handle.event(Event::Paced(pace));
    plant.handle.event(Event::Projector(ProjectorHealth {
        temperature_c: Some(70.04),
        led_current: Some(600),
        faults: Some(0b10),
        fault_words: Some(vec!["LED"]),
    }));
    plant.handle.event(Event::CameraTemperature(Some(-3.26)));
    plant.handle.event(Event::Drift(Some(Drift {
        rms_px: 1.2344,
        drifted: true,
    })));
    let words = plc.read_input_registers(600, 40).await.unwrap().unwrap();
    let long = |k: usize| u32_at(&words, k);
    assert_eq!((long(0), long(2), long(4)), (2000, 60_000, 12));
    assert_eq!((long(6), long(8)), (4, 2), "counted since the start");
    assert_eq!((long(16), long(18), long(20)), (0x1_0002, 3, 1));
    assert_eq!(
        words[22..30],
        [37, 1234, 65534, 512, (-33_i16).cast_unsigned(), 700, 2, 1]
    );
    // Throttled now; under-voltage at some time before.
    assert_eq!(words[30..37], [0b0101_0100, 0b10, 600, 6, 12, 0, 7]);
    assert_eq!(words[37], 1234);
    assert_eq!(words[38..], [0; 2], "reserved registers read 0");
    let warning = plc.read_input_registers(103, 1).await.unwrap().unwrap();
    assert_eq!(warning[0] & 0x301, 0x301, "geometry, power and temperature");
    let stored = plc.read_input_registers(700, 64).await.unwrap().unwrap();
    assert_eq!((stored[0], stored[1], stored[63]), (0b11, 1, 1 << 15));
    assert_eq!(stored.iter().map(|word| word.count_ones()).sum::<u32>(), 4);
}

#[tokio::test]
async fn processing_time_is_that_of_the_stages_after_the_exposure_and_the_longest_is_kept() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    plc.write_single_register(1, 1).await.unwrap().unwrap();
    plant.work();
    let result = plc.read_input_registers(200, 120).await.unwrap().unwrap();
    let words = plc.read_input_registers(610, 4).await.unwrap().unwrap();
    // The rest of the cycle is hand-over; here the cycle is shorter than its stages' times.
    let processing = u32_at(&result, 20).max(1_740);
    assert_eq!(
        (u32_at(&words, 0), u32_at(&words, 2)),
        (processing, processing)
    );
}

#[tokio::test]
async fn the_thirty_third_waiting_result_is_not_queued_and_latches_the_overflow() {
    let plant = Plant::with(Options::default(), true).await;
    let mut plc = plant.client().await;
    plc.write_single_register(0, 0x41).await.unwrap().unwrap();
    for token in 1..=33 {
        plc.write_single_register(1, token).await.unwrap().unwrap();
        plant.work();
    }
    let overflow = |words: &[u16]| words[0] & status::BUFFER_OVERFLOW != 0;
    let full = plc.read_input_registers(100, 32).await.unwrap().unwrap();
    assert_eq!((overflow(&full), full[17]), (true, 32));
    let (newest, oldest) = (
        plc.read_input_registers(200, 3).await.unwrap().unwrap(),
        plc.read_input_registers(400, 3).await.unwrap().unwrap(),
    );
    assert_eq!((newest[2], oldest[2]), (33, 1));
    plc.write_single_register(0, 0x45).await.unwrap().unwrap();
    let popped = plc.read_input_registers(100, 32).await.unwrap().unwrap();
    assert_eq!((overflow(&popped), popped[17]), (true, 31));
    plc.write_single_register(0, 0x51).await.unwrap().unwrap();
    let reset = plc.read_input_registers(100, 32).await.unwrap().unwrap();
    assert_eq!((overflow(&reset), reset[17]), (false, 31));
}
