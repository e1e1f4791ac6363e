//! Draws an invented robot for a minute of its time: `cargo run -p rohrpost-gui-bridge --example scene
//! scene.rrd`, then `rerun scene.rrd` or `cargo xtask picture scene.rrd scene.png`.

use rohrpost::schema::Value;
use rohrpost::types::{Cell, LaserScan, OccupancyGrid, Odometry, Pose, Twist};
use rohrpost_gui_bridge::{Level, Scene, Sink};
use rohrpost_launch::survey::Standing;
use std::f64::consts::TAU;

const HZ: u64 = 20;
const SECONDS: u64 = 60;
const BEAMS: usize = 361;
const RANGE_M: f64 = 8.0;
const CELL_M: f64 = 0.05;
const TILE_CELLS: i64 = 64;

/// Walls as lines from one point to another, metres.
const WALLS: [[f64; 4]; 15] = [
    [-10.0, -6.0, 10.0, -6.0],
    [10.0, -6.0, 10.0, 6.0],
    [10.0, 6.0, -10.0, 6.0],
    [-10.0, 6.0, -10.0, -6.0],
    [-3.0, -6.0, -3.0, -4.4],
    [-3.0, -3.0, -3.0, -1.4],
    [4.0, -6.0, 4.0, -4.5],
    [4.0, -3.0, 4.0, -1.4],
    [-10.0, -1.4, -7.4, -1.4],
    [-6.0, -1.4, 6.2, -1.4],
    [7.6, -1.4, 10.0, -1.4],
    [-5.0, 1.4, 6.6, 1.4],
    [-5.0, 1.4, -5.0, 3.0],
    [-5.0, 4.4, -5.0, 6.0],
    [2.0, 4.6, 2.0, 6.0],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sink = match std::env::args().nth(1).as_deref() {
        Some("--window") => Sink::Window,
        Some(url) if url.starts_with("rerun") => Sink::Viewer(url.into()),
        Some(path) => Sink::file(path),
        None => Sink::file("scene.rrd"),
    };
    let live = !matches!(sink, Sink::File { .. });
    let start_ns = 1_750_000_000_000_000_000;
    let mut scene = Scene::open("example", sink, 0.0, start_ns)?;
    let mut map = Map::default();
    for tick in 0..=SECONDS * HZ {
        if live {
            std::thread::sleep(std::time::Duration::from_millis(1000 / HZ));
        }
        scene.set_time(start_ns + tick * 1_000_000_000 / HZ);
        let seconds = tick as f64 / HZ as f64;
        drive(&mut scene, seconds);
        if tick % 4 == 0 {
            look(&mut scene, &mut map, seconds)?;
        }
        if tick % HZ == 0 {
            flow(&mut scene, tick / HZ);
            happen(&mut scene, tick / HZ);
        }
        if !live {
            // Faster than it would happen, but all of it.
            scene.settle(std::time::Duration::from_secs(10));
        }
    }
    scene.close()?;
    Ok(())
}

/// Once around, through the corridor and the rooms.
fn pose(seconds: f64) -> Pose {
    const WAY: [[f64; 2]; 11] = [
        [-8.5, 0.0],
        [-2.0, 0.0],
        [5.0, 0.0],
        [8.4, 0.6],
        [8.2, 3.4],
        [4.0, 3.6],
        [0.0, 3.2],
        [-3.6, 3.7],
        [-7.4, 3.6],
        [-8.0, 0.2],
        [-6.7, -3.7],
    ];
    let place = (seconds / SECONDS as f64).clamp(0.0, 0.999) * (WAY.len() - 1) as f64;
    let (leg, share) = (place as usize, place.fract());
    // Catmull and Rom's curve through the points, so that the robot turns as robots do.
    let point = |index: isize| WAY[index.clamp(0, WAY.len() as isize - 1) as usize];
    let [a, b, c, d] = [-1, 0, 1, 2].map(|step| point(leg as isize + step));
    let on = |axis: usize| {
        let (p, q, r, s) = (a[axis], b[axis], c[axis], d[axis]);
        let [square, cube] = [share * share, share * share * share];
        let at =
            2.0 * q + (r - p) * share + (2.0 * p - 5.0 * q + 4.0 * r - s) * square + (3.0 * (q - r) + s - p) * cube;
        let slope = (r - p) + 2.0 * (2.0 * p - 5.0 * q + 4.0 * r - s) * share + 3.0 * (3.0 * (q - r) + s - p) * square;
        (at / 2.0, slope)
    };
    let ((x_m, along_x), (y_m, along_y)) = (on(0), on(1));
    Pose { x_m, y_m, heading_rad: along_y.atan2(along_x) }
}

fn drive(scene: &mut Scene, seconds: f64) {
    let truth = pose(seconds);
    scene.pose("slam.0", &truth);
    let drift = seconds / SECONDS as f64;
    let start = pose(0.0);
    let (sin, cos) = (0.07 * drift).sin_cos();
    let (x, y) = (truth.x_m - start.x_m, truth.y_m - start.y_m);
    let pose = Pose {
        x_m: start.x_m + cos * x - sin * y + 0.3 * drift,
        y_m: start.y_m + sin * x + cos * y,
        heading_rad: truth.heading_rad + 0.07 * drift,
    };
    scene.odometry("motor.0", &Odometry { pose, twist: Twist::default() });
}

/// How far it is from `from` in direction `angle` to the next wall.
fn wall(from: [f64; 2], angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let hit = |[ax, ay, bx, by]: &[f64; 4]| {
        let (wall_x, wall_y, to_x, to_y) = (bx - ax, by - ay, ax - from[0], ay - from[1]);
        let across = cos * wall_y - sin * wall_x;
        let range = (to_x * wall_y - to_y * wall_x) / across;
        let along = (to_x * sin - to_y * cos) / across;
        (across.abs() > 1e-9 && range > 0.0 && (0.0..=1.0).contains(&along)).then_some(range)
    };
    WALLS.iter().filter_map(hit).fold(RANGE_M, f64::min)
}

fn look(scene: &mut Scene, map: &mut Map, seconds: f64) -> Result<(), rohrpost_gui_bridge::DrawError> {
    let at = pose(seconds);
    let (start, step) = (-0.75 * TAU / 2.0, 0.75 * TAU / (BEAMS - 1) as f64);
    let beams = (0..BEAMS).map(|beam| start + beam as f64 * step);
    let noise = |beam: usize| 0.015 * ((beam * 7919 + (seconds * 50.0) as usize * 104_729) % 199) as f64 / 99.5 - 0.015;
    let ranges: Vec<f64> = beams.map(|angle| wall([at.x_m, at.y_m], at.heading_rad + angle)).collect();
    for (beam, range) in ranges.iter().enumerate() {
        map.see(&at, at.heading_rad + start + beam as f64 * step, *range);
    }
    let scan = LaserScan {
        start_rad: start as f32,
        step_rad: step as f32,
        range_max_m: RANGE_M as f32,
        ranges_m: ranges
            .iter()
            .enumerate()
            .map(|(beam, range)| (if *range < RANGE_M { range + noise(beam) } else { RANGE_M }) as f32)
            .collect(),
        pose: None,
    };
    scene.scan("laser.0", &scan, "slam.0", &Pose::default());
    map.changed().iter().try_for_each(|tile| scene.grid("slam.0", tile))
}

/// A map that counts how often a square stopped a beam.
#[derive(Default)]
struct Map {
    tiles: std::collections::BTreeMap<(i64, i64), (Vec<u8>, bool)>,
}

impl Map {
    fn see(&mut self, at: &Pose, angle: f64, range: f64) {
        let (sin, cos) = angle.sin_cos();
        let steps = (range / CELL_M * 1.3) as usize;
        for step in 0..steps {
            let along = step as f64 * CELL_M / 1.3;
            self.cell(
                at.x_m + along * cos,
                at.y_m + along * sin,
                |cell| if cell > 100 { 30 } else { cell.saturating_sub(4) },
            );
        }
        if range < RANGE_M {
            self.cell(
                at.x_m + range * cos,
                at.y_m + range * sin,
                |cell| if cell > 100 { 80 } else { (cell + 40).min(100) },
            );
        }
    }

    fn cell(&mut self, x: f64, y: f64, change: impl FnOnce(u8) -> u8) {
        let (column, row) = ((x / CELL_M).floor() as i64, (y / CELL_M).floor() as i64);
        let place = (column.div_euclid(TILE_CELLS), row.div_euclid(TILE_CELLS));
        let empty = || (vec![Cell::UNKNOWN.0; (TILE_CELLS * TILE_CELLS) as usize], false);
        let (cells, changed) = self.tiles.entry(place).or_insert_with(empty);
        let cell = &mut cells[(row.rem_euclid(TILE_CELLS) * TILE_CELLS + column.rem_euclid(TILE_CELLS)) as usize];
        let now = change(*cell);
        *changed |= now != *cell;
        *cell = now;
    }

    fn changed(&mut self) -> Vec<OccupancyGrid> {
        let side_m = TILE_CELLS as f64 * CELL_M;
        let changed = self.tiles.iter_mut().filter(|(_, (_, changed))| *changed);
        let tile = |(&(column, row), (cells, changed)): (&(i64, i64), &mut (Vec<u8>, bool))| {
            *changed = false;
            OccupancyGrid {
                origin: Pose { x_m: column as f64 * side_m, y_m: row as f64 * side_m, heading_rad: 0.0 },
                resolution_m: CELL_M as f32,
                columns: TILE_CELLS as u32,
                rows: TILE_CELLS as u32,
                cells: cells.clone(),
            }
        };
        changed.map(tile).collect()
    }
}

fn flow(scene: &mut Scene, second: u64) {
    let wave = |period: f64| (second as f64 / period * TAU).sin();
    let burst = if (34..40).contains(&second) { 1.0 } else { 0.0 };
    for (class, rate, losses, p50, p99) in [
        ("motor", 50.0 + wave(9.0), 0, 6.0 + wave(5.0), 14.0 + 2.0 * wave(7.0)),
        ("laser", 40.0 + 0.5 * wave(4.0), 0, 9.0 + wave(6.0), 22.0 + 3.0 * wave(11.0)),
        ("slam", 24.0 + 4.0 * wave(17.0), 0, 14.0 + 2.0 * wave(8.0), 37.0 + 5.0 * wave(13.0)),
        (
            "output",
            8.0 + 70.0 * burst,
            second.saturating_sub(34).min(6) * 12,
            20.0 + 3.0 * wave(5.0),
            60.0 + 35.0 * burst,
        ),
    ] {
        scene.traffic(class, rate, losses);
        scene.latency(class, p50, p99);
    }
    let battery = Value::Map(vec![
        ("volts".into(), Value::F(12.4 - second as f64 * 0.01 + 0.05 * wave(3.0))),
        ("maker".into(), Value::Text("Akku AG".into())),
    ]);
    scene.generic("battery.0", "gauge", &battery);
}

fn happen(scene: &mut Scene, second: u64) {
    let modules = ["motor.0", "laser.0", "slam.0", "pilot.0", "output.0"];
    for (index, module) in modules.into_iter().enumerate() {
        match second.checked_sub(index as u64) {
            Some(0) => scene.module_state(module, Standing::Starting, ""),
            Some(2) => scene.module_state(module, Standing::On, ""),
            _ => {}
        }
    }
    match second {
        3 => scene.output_line("laser.0", Level::Info, "361 beams, 0.75 turns, 5 Hz"),
        7 => scene.output_line("pilot.0", Level::Info, "goal (8.2, 3.4): 17.9 m to go"),
        21 => scene.module_state(
            "laser.0",
            Standing::Restarting { attempt: 1, most: 5 },
            "was killed by signal 9; starts again in 1s",
        ),
        22 => scene.module_state("laser.0", Standing::Starting, ""),
        24 => scene.module_state("laser.0", Standing::On, "back, adopted 3 packages"),
        31 => scene.output_line("pilot.0", Level::Info, "goal reached, next (-6.7, -3.7)"),
        35 => scene.module_state("output.0", Standing::Error, "disk full: dropping lines of level debug"),
        41 => scene.module_state("output.0", Standing::On, "72 lines were dropped"),
        48 => scene.output_line("slam.0", Level::Info, "loop closed: 0.31 m, 4.0° off"),
        55 => scene.output_line("motor.0", Level::Warning, "left wheel: 41 °C"),
        _ => {}
    }
}
