use super::*;
use proptest::prelude::*;

fn read(text: &str) -> Vec<Result<LogRecord, LogError>> {
    Reader::new(text.as_bytes(), Settings::default()).collect()
}

fn flaw(text: &str) -> (u64, Flaw) {
    match read(text).pop() {
        Some(Err(LogError::Malformed { line, flaw })) => (line, flaw),
        other => panic!("{text:?} gives {other:?}"),
    }
}

#[test]
fn records_are_read_in_the_order_of_the_lines() {
    let log = "# remark\nPARAM offset 0.0 nohost 0\nNEFF 15\nODOM 1 2 3 0.5 -0.25 0 9.5 host 9.5\n\
               FLASER 3 1.5 81.83 0.01 4 5 6 7 8 9 8.5 host 8.5\nTRUEPOS 0 0 0\n\n";
    let records: Vec<LogRecord> = read(log).into_iter().map(Result::unwrap).collect();
    let odometry = Odometry {
        pose: Pose { x_m: 1.0, y_m: 2.0, heading_rad: 3.0 },
        twist: Twist { speed_m_s: 0.5, turn_rate_rad_s: -0.25 },
    };
    let scan = LaserScan {
        start_rad: -FRAC_PI_2 as f32,
        step_rad: FRAC_PI_2 as f32,
        range_max_m: 80.0,
        ranges_m: vec![1.5, 81.83, 0.01],
        pose: Some(Pose { x_m: 4.0, y_m: 5.0, heading_rad: 6.0 }),
    };
    let believed = Pose { x_m: 7.0, y_m: 8.0, heading_rad: 9.0 };
    assert_eq!(scan.hits().count(), 2, "81.83 is nothing");
    assert_eq!(
        records,
        [
            LogRecord::Param { name: "offset".into(), value: "0.0".into() },
            LogRecord::Odometry { stamp_s: 9.5, odometry },
            LogRecord::Scan { stamp_s: 8.5, scan, odometry: believed },
        ]
    );
    let mut reader = Reader::new(log.as_bytes(), Settings::default());
    assert_eq!((reader.by_ref().count(), reader.skipped(), reader.line()), (3, 4, 7));
}

#[test]
fn beams_are_a_degree_apart_from_the_right() {
    for (readings, step_degrees, last_degrees) in
        [(180, 1.0, 89.0), (181, 1.0, 90.0), (360, 0.5, 89.5), (361, 0.5, 90.0)]
    {
        let (start_rad, step_rad) = beams(readings);
        assert_eq!(start_rad.to_degrees(), -90.0);
        assert!((step_rad.to_degrees() - step_degrees).abs() < 1e-9, "{readings}");
        assert!(((start_rad + (readings - 1) as f64 * step_rad).to_degrees() - last_degrees).abs() < 1e-9);
    }
    assert!(beams(0).1.is_finite() && beams(1).1.is_finite());
}

#[test]
fn bad_lines_are_named_and_passed() {
    let number = |field, found: &str| Flaw::NotANumber { field, found: found.into() };
    for (text, line, expected) in [
        ("ODOM 1 2", 1, Flaw::Missing("theta")),
        ("\n\nODOM 1 x 3 0 0 0 1 h 1", 3, number("y", "x")),
        ("ODOM 1 nan 3 0 0 0 1 h 1", 1, number("y", "nan")),
        ("ODOM 1 2 3 0 0 0 inf h 1", 1, number("stamp", "inf")),
        ("ODOM 1 2 3 0 0 0 1 h 1 2 3", 1, Flaw::TooMany(2)),
        ("FLASER", 1, Flaw::Missing("number of readings")),
        ("FLASER -3 1 1 1", 1, number("number of readings", "-3")),
        ("FLASER 99999999999 1", 1, Flaw::TooManyReadings(99_999_999_999)),
        ("FLASER 4 1 2 3", 1, Flaw::Missing("reading")),
        ("FLASER 2 1 2 0 0 0 0 0 0 5", 1, Flaw::Missing("host")),
        ("PARAM alone", 1, Flaw::Missing("value")),
    ] {
        assert_eq!(flaw(text), (line, expected), "{text:?}");
    }
    let items = read("ODOM 1 2\nODOM 1 2 3 0 0 0 1 h 1\n");
    assert!(items[0].is_err() && items[1].is_ok() && items.len() == 2, "reading goes on");
}

#[test]
fn endless_and_foreign_lines_are_passed() {
    let mut log = b"ODOM 1 2 3 0 0 0 1 h 1\nFLASER \xff\xfe\nFLASER ".to_vec();
    log.extend(std::iter::repeat_n(b'7', 5 * LINE_BYTES_MAX));
    log.extend(b"\nODOM 1 2 3 0 0 0 2 h 2\n");
    let items: Vec<_> = Reader::new(log.as_slice(), Settings::default()).collect();
    assert!(matches!(items[1], Err(LogError::Malformed { line: 2, flaw: Flaw::NotText })));
    assert!(matches!(items[2], Err(LogError::Malformed { line: 3, flaw: Flaw::TooLong })));
    assert!(matches!(items[3], Ok(LogRecord::Odometry { stamp_s: 2.0, .. })));
    assert_eq!(items.len(), 4);
}

#[test]
fn packed_and_plain_logs_are_the_same() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let read = |name: &str| -> Vec<String> {
        open(&data.join(name), Settings::default()).unwrap().map(|item| format!("{item:?}")).collect()
    };
    assert_eq!(read("small.log"), read("small.log.gz"));
    assert!(read("small.log").len() > 50);
    assert!(open(&data.join("missing.log"), Settings::default()).is_err());
}

#[test]
fn a_torn_archive_is_an_error_at_its_end() {
    let packed = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/small.log.gz")).unwrap();
    let torn = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(torn.path(), &packed[..packed.len() / 2]).unwrap();
    let items: Vec<_> = open(torn.path(), Settings::default()).unwrap().collect();
    assert!(matches!(items.last(), Some(Err(LogError::Io { .. }))));
    assert!(items.iter().filter(|item| item.is_ok()).count() > 5, "what was whole was read");
}

proptest! {
    #[test]
    fn no_bytes_panic_or_lose_lines(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let mut reader = Reader::new(bytes.as_slice(), Settings::default());
        let items = reader.by_ref().count() as u64;
        prop_assert_eq!(items + reader.skipped(), reader.line());
    }

    #[test]
    fn what_is_written_is_read(
        ranges in prop::collection::vec(0.0f32..90.0, 0..50),
        (x, y, theta) in (-99.0..99.0, -99.0..99.0, -4.0..4.0),
        stamp in 0.0..1e9,
    ) {
        let readings: String = ranges.iter().map(|range| format!("{range} ")).collect();
        let line = format!("FLASER {} {readings}{x} {y} {theta} 0 0 0 {stamp} h {stamp}\n", ranges.len());
        let expected = Pose { x_m: x, y_m: y, heading_rad: theta };
        match read(&line).pop() {
            Some(Ok(LogRecord::Scan { stamp_s, scan, .. })) => {
                prop_assert_eq!(stamp_s, stamp);
                prop_assert_eq!(scan.ranges_m, ranges);
                prop_assert_eq!(scan.pose, Some(expected));
            }
            other => prop_assert!(false, "{:?}", other),
        }
    }
}
