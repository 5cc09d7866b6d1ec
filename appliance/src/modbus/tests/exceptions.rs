//! Requests that are impossible, and requests that contradict themselves.

use super::*;

#[tokio::test]
async fn what_cannot_be_is_an_exception_and_the_connection_lives_on() {
    let plant = Plant::new().await;
    let mut plc = plant.client().await;
    for (address, count) in [
        (32, 1),
        (99, 1),
        (131, 2),
        (319, 2),
        (583, 2),
        (640, 1),
        (764, 1),
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
    for (address, word) in [(0, 0x0201), (0, 0x8001), (2, 10_000), (24, 1)] {
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
