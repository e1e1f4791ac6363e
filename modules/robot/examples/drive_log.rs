//! Drives the simulated robot through a map and writes what a CARMEN logger would have, with true poses for the scans:
//! `cargo run -p rohrpost-robot --example drive_log -- MAP SECONDS SEED OUT.log`. Squares of
//! a benchmark's map count as 0.5 m. `tests/data/small.log` began so.

use rohrpost_robot::{pilot, simulator, world};
use std::error::Error;
use std::io::Write;

/// Odometry comes ten times a second, a scan each half second.
const ODOMETRY_NS: u64 = 100_000_000;
const SCAN_EVERY: u64 = 5;
/// Stamps begin here, so that those next to 0 are far off from the first line on.
const START_S: f64 = 20.0;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [map, seconds, seed, log] = arguments.as_slice() else {
        return Err("usage: drive_log MAP SECONDS SEED OUT.log".into());
    };
    let (seed, ticks) = (seed.parse()?, seconds.parse::<u64>()? * 10);
    let map = std::fs::read_to_string(map)?;
    let octile = map.starts_with("type octile");
    let world = if octile { world::World::parse_octile(&map, 0.5)? } else { world::World::parse(&map)? };
    let mut robot = simulator::Simulator::new(world, simulator::Settings { seed, ..Default::default() });
    let mut pilot = pilot::Pilot::new(pilot::Settings { seed, ..Default::default() });
    let mut out = std::io::BufWriter::new(std::fs::File::create(log)?);
    writeln!(out, "# A simulated drive, as a CARMEN log.\nPARAM robot_frontlaser_offset 0.0 nohost 0")?;
    for tick in 1..=ticks {
        let scan = robot.scan();
        robot.command(pilot.drive(&scan), (tick - 1) * ODOMETRY_NS)?;
        robot.step_to(tick * ODOMETRY_NS);
        let (stamp_s, odometry) = (START_S + tick as f64 * 0.1, robot.odometry());
        let place = format!("{:.4} {:.4} {:.4}", odometry.pose.x_m, odometry.pose.y_m, odometry.pose.heading_rad);
        let twist = format!("{:.3} {:.3} 0", odometry.twist.speed_m_s, odometry.twist.turn_rate_rad_s);
        writeln!(out, "ODOM {place} {twist} {stamp_s:.2} simulated {stamp_s:.2}")?;
        if tick % SCAN_EVERY == 0 {
            let (scan, truth) = (robot.scan(), robot.true_pose());
            write!(out, "FLASER {}", scan.ranges_m.len())?;
            for range_m in &scan.ranges_m {
                // As SICK's: a reading far beyond the range says that nothing came back.
                write!(out, " {:.2}", if *range_m < scan.range_max_m { *range_m } else { 81.83 })?;
            }
            let pose = format!("{:.4} {:.4} {:.4}", truth.x_m, truth.y_m, truth.heading_rad);
            writeln!(out, " {pose} {place} {stamp_s:.2} simulated {stamp_s:.2}")?;
            // What the Intel log has after each scan: the same place again with a stamp next to 0, and a remark of its
            // filter.
            writeln!(out, "ODOM {place} 0 0 0 6.95e-62 simulated 6.95e-62\nNEFF 15")?;
        }
    }
    out.flush()?;
    println!("{} bumps, at {:?}", robot.bumps(), robot.true_pose());
    Ok(())
}
