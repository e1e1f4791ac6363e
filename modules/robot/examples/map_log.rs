//! Maps a CARMEN log with the poses it holds: `cargo run -p rohrpost-robot --example map_log -- FILE OUT.pgm
//! [CELL_M]`.

use rohrpost_robot::{carmen, grid, playback};
use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [log, picture, rest @ ..] = arguments.as_slice() else {
        return Err("usage: map_log FILE OUT.pgm [CELL_M]".into());
    };
    let mut settings = grid::Settings::default();
    if let Some(cell_m) = rest.first() {
        settings.resolution_m = cell_m.parse()?;
    }
    let mut map = grid::Mapper::new(settings);
    let mut log = playback::Playback::new(carmen::open(Path::new(log), carmen::Settings::default())?, 1.0)?;
    let (start, mut mapping) = (Instant::now(), Duration::ZERO);
    let mut last_due_ns = 0;
    for item in log.by_ref() {
        let due = item?;
        last_due_ns = due.due_ns;
        if let carmen::LogRecord::Scan { scan, .. } = due.record
            && let Some(pose) = scan.pose
        {
            let before = Instant::now();
            map.integrate(&scan, &pose)?;
            mapping += before.elapsed();
        }
    }
    println!("{:?}, {:.1} s of log in {:?}", log.counters(), last_due_ns as f64 / 1e9, start.elapsed());
    println!("{:?} for a scan", mapping / u32::try_from(log.counters().scans)?.max(1));
    println!("{:?} in {} tiles", map.counts(), map.tiles().count());
    std::fs::write(picture, map.to_pgm())?;
    Ok(())
}
