//! Files of strangers: read where they are plain, else refused with the line.

use crate::error::Exit;
use crate::study::Characteristic;
use crate::study::table;

fn read(bytes: &[u8]) -> Result<Vec<Characteristic>, String> {
    table::read(bytes, "values.csv").map_err(|failure| {
        assert_eq!(failure.exit, Exit::Content);
        failure.to_string()
    })
}

#[test]
fn plain_files_are_read_however_they_are_written() {
    let expected = [("1", "A", 0.29), ("2", "A", -0.5)];
    for text in [
        "part,operator,value\n1,A,0.29\n2,A,-.5\n",
        "\u{feff}Part;Operator;Value\r\n1;A;0,29\r\n2;A;-0,5",
        "value,note,appraiser,part\n\n\"0,29\",\"a, \"\"b\"\"\",A,1\n-5e-1,\"two\nlines\", A ,2\n\n",
    ] {
        let all = read(text.as_bytes()).unwrap();
        let found: Vec<_> = all[0]
            .readings
            .iter()
            .map(|reading| (&*reading.part, &*reading.appraiser, reading.value.to_f64()))
            .collect();
        assert_eq!(found, expected, "{text}");
    }
}

#[test]
fn what_is_not_plain_is_refused_with_its_line() {
    let long = format!("part,value\n1,1\n1,{}\n", "1".repeat(10 << 20));
    let name = format!("part,value\n{},1\n", "n".repeat(300));
    let wide = format!("value{}\n1\n", ",x".repeat(2000));
    let open = format!("value\n\"1\n{}", "2\n".repeat(1 << 20));
    for (bytes, words) in [
        (&b""[..], "there is nothing in it"),
        (
            b"part,weight\n1,2\n",
            "line 1: there is no column \"value\": name the columns",
        ),
        (
            b"value,value\n1,2\n",
            "line 1: the column value is there twice",
        ),
        (b"part,value\n1,1\n2,\n", "line 3: the value is empty"),
        (
            b"part,value\n1,1\n2\n",
            "line 3: it has 1 cells, the first line 2",
        ),
        (
            b"part,value\n1,1\n2,1,5\n",
            "line 3: it has 3 cells, the first line 2: a decimal comma needs ;",
        ),
        (
            b"part,value\n1,1\n\n2,ten\n",
            "line 4: \"ten\" is not a number",
        ),
        (
            b"part,value\n1,1e400\n",
            "line 2: \"1e400\" is not a number",
        ),
        (b"part,value\n1,nan\n", "line 2: \"nan\""),
        (b"part,value\n1,\xff\n", "line 2: cell 2 is not UTF-8"),
        (
            b"part,value\n1\0,1\n",
            "line 2: cell 1 has control characters",
        ),
        (long.as_bytes(), "line 3: it has more than 1048576 bytes"),
        (name.as_bytes(), "line 2: \"nnn"),
        (wide.as_bytes(), "line 1: it has more than"),
        (open.as_bytes(), "is a quotation mark not closed?"),
    ] {
        let refused = read(bytes).unwrap_err();
        assert!(
            refused.contains(words) && refused.len() < 900,
            "{words:?}: {refused}"
        );
    }
}

#[test]
fn a_history_is_read_from_its_oldest_result_on() {
    let text = "seq,time_utc,recipe,fingerprint,part_id,verdict,hole [mm],hole sigma,hole low,hole high,hole decision,hole U,hole expected\r\n\
        9,,1,ab,7,INVALID,,,,,,,\r\n8,,1,ab,7,INVALID,3,,1,2,2,,\r\n7,,1,ab,6,FAIL,,,1,2,0,,\r\n6,,1,ab,6,PASS,1.5,0.001,1,2,3,0.004,\r\n5,,1,ab,5,PASS,1.25,0.001,1,2,3,0.004,\r\n";
    let all = read(text.as_bytes()).unwrap();
    let [hole] = &all[..] else {
        panic!("one gauge")
    };
    assert_eq!((hole.name.as_str(), hole.unit.as_str()), ("hole", "mm"));
    let found: Vec<_> = hole
        .readings
        .iter()
        .map(|reading| {
            (
                reading.at,
                &*reading.part,
                reading.value.to_f64(),
                reading.uncertainty,
            )
        })
        .collect();
    assert_eq!(
        found,
        [(5, "5", 1.25, Some(0.004)), (6, "6", 1.5, Some(0.004))]
    );
    assert_eq!((hole.left_out.invalid, hole.left_out.not_measured), (1, 1));
}
