//! Logs of CARMEN, as the demonstration plays them: read, believed or not, played, and drawn into a map.

use rohrpost_modules::fusion::{History, Records, Stamp};
use rohrpost_robot::carmen::{LogError, LogRecord, Reader, Settings};
use rohrpost_robot::grid::{Mapper, Settings as GridSettings};
use rohrpost_robot::playback::Playback;

/// Scans that are drawn of one input: each may touch some thousand cells.
const SCANS: usize = 4;

pub(crate) fn run(data: &[u8]) {
    let mut reader = Reader::new(data, Settings::default());
    let lines = data.split(|byte| *byte == b'\n').count() as u64;
    for item in reader.by_ref() {
        match item {
            Ok(record) => assert!(record.stamp_s().is_none_or(f64::is_finite)),
            Err(LogError::Malformed { line, flaw }) => {
                assert!((1..=lines).contains(&line) && !flaw.to_string().is_empty());
            }
            Err(error @ LogError::Io { .. }) => panic!("bytes can be read: {error}"),
        }
    }
    assert!(reader.line() <= lines && reader.skipped() <= reader.line());
    play(data);
}

fn play(data: &[u8]) {
    let speed = 1.0 + data.len() as f64;
    let playback = Playback::new(Reader::new(data, Settings::default()), speed).unwrap_or_else(|e| panic!("{e}"));
    let (mut last_ns, mut scans, mut sequence) = (0, 0, 0);
    let (mut map, mut poses) = (Mapper::new(GridSettings::default()), History::new(8, 0));
    for due in playback {
        let due = due.unwrap_or_else(|error| panic!("bytes can be read: {error}"));
        assert!(due.due_ns >= last_ns, "due times never go back");
        last_ns = due.due_ns;
        match due.record {
            LogRecord::Odometry { odometry, .. } => {
                sequence += 1;
                let taken = poses.push(Stamp::new(0, due.due_ns), sequence, odometry.pose);
                assert_eq!(taken, Ok(()), "due times never go back");
            }
            LogRecord::Scan { scan, odometry, .. } if scans < SCANS => {
                scans += 1;
                let pose = poses.at(Stamp::new(0, due.due_ns), u64::MAX).ok().or(scan.pose).unwrap_or(odometry);
                let _ = map.integrate(&scan, &pose);
            }
            LogRecord::Scan { .. } | LogRecord::Param { .. } => {}
        }
    }
    for index in map.take_changed() {
        assert!(map.tile(index).is_some());
    }
}
