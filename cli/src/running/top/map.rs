//! The page *map*: walls that a scanner has seen, the way of the robot, and the newest scan.
//!
//! ```text
//! stream of LaserScan ──┐ records, copied
//! stream of Odometry  ──┴─▶ MapReader ──hits at the nearest pose──▶ MapPage ──▶ canvas
//! ```
//!
//! Any robot has it that writes a stream of each of these types on the node that `top` runs on.

use crate::look::target::Running;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::widgets::Widget;
use ratatui::widgets::canvas::{Canvas, Points};
use rohrpost::description::noted;
use rohrpost::schema::{DataKind, Schema, Type};
use rohrpost::types::{LaserScan, Odometry, Pose};
use rohrpost::wire::from_bytes;
use rohrpost_mailbox::{Next, Participant, StreamId, StreamReader};
use std::collections::{BTreeSet, VecDeque};

/// Edge of a cell in which walls are remembered.
const CELL_M: f64 = 0.1;
const WALLS_MAX: usize = 50_000;
/// Points of the way, and their least distance.
const WAY_MAX: usize = 5_000;
const WAY_STEP_M: f64 = 0.1;
/// Poses that a scan may still belong to.
const POSES_MAX: usize = 256;

/// What is drawn.
#[derive(Default)]
pub(super) struct MapPage {
    walls: BTreeSet<(i32, i32)>,
    way: VecDeque<(f64, f64)>,
    scan: Vec<(f64, f64)>,
    poses: VecDeque<(u64, Pose)>,
    scans: u64,
}

impl MapPage {
    /// The robot was there at this time.
    pub(super) fn at(&mut self, stamp_ns: u64, pose: Pose) {
        if self.poses.len() == POSES_MAX {
            self.poses.pop_front();
        }
        self.poses.push_back((stamp_ns, pose));
        let point = (pose.x_m, pose.y_m);
        let is_far = |last: &(f64, f64)| (last.0 - point.0).hypot(last.1 - point.1) >= WAY_STEP_M;
        if is_drawable(point) && self.way.back().is_none_or(is_far) {
            if self.way.len() == WAY_MAX {
                self.way.pop_front();
            }
            self.way.push_back(point);
        }
    }

    /// The scanner saw this, from where the robot was then.
    pub(super) fn seen(&mut self, stamp_ns: u64, scan: &LaserScan) {
        let nearest = self.poses.iter().min_by_key(|(at_ns, _)| at_ns.abs_diff(stamp_ns));
        let Some(pose) = scan.pose.or(nearest.map(|(_, pose)| *pose)) else { return };
        let hit = |(angle_rad, range_m): (f64, f64)| {
            let (sin, cos) = (pose.heading_rad + angle_rad).sin_cos();
            (pose.x_m + range_m * cos, pose.y_m + range_m * sin)
        };
        self.scan = scan.hits().map(hit).filter(|point| is_drawable(*point)).collect();
        self.scans += 1;
        let cells = self.scan.iter().map(|(x, y)| ((x / CELL_M).floor() as i32, (y / CELL_M).floor() as i32));
        let room = WALLS_MAX.saturating_sub(self.walls.len());
        self.walls.extend(cells.take(room));
    }

    /// The line above the map.
    pub(super) fn title(&self) -> String {
        match self.way.back() {
            Some((x, y)) => format!("robot @ at {x:.2} m, {y:.2} m; {} scans, the newest in red", self.scans),
            None => "no pose yet".into(),
        }
    }

    pub(super) fn draw(&self, area: Rect, to: &mut Buffer, colours: bool) {
        if area.is_empty() {
            return;
        }
        let walls: Vec<(f64, f64)> = self.walls.iter().map(|(x, y)| (center(*x), center(*y))).collect();
        let way: Vec<(f64, f64)> = self.way.iter().copied().collect();
        let [x, y] = bounds(walls.iter().chain(&way).chain(&self.scan), area);
        let colour = |colour| if colours { colour } else { Color::Reset };
        Canvas::default()
            .marker(Marker::Braille)
            .x_bounds(x)
            .y_bounds(y)
            .paint(|context| {
                for (coords, of) in [(&walls, Color::Gray), (&way, Color::Green), (&self.scan, Color::Red)] {
                    context.draw(&Points { coords, color: colour(of) });
                    context.layer();
                }
                if let Some((x, y)) = self.way.back() {
                    context.print(*x, *y, "@");
                }
            })
            .render(area, to);
    }
}

/// Whether a point can be on a map: a log or a broken scanner may have any number.
fn is_drawable((x, y): (f64, f64)) -> bool {
    x.abs() < 1e5 && y.abs() < 1e5
}

fn center(cell: i32) -> f64 {
    (f64::from(cell) + 0.5) * CELL_M
}

/// Bounds of both axes with all points in them, of one scale: a character is two dots wide and four high.
fn bounds<'p>(points: impl Iterator<Item = &'p (f64, f64)> + Clone, area: Rect) -> [[f64; 2]; 2] {
    let range = |of: fn(&(f64, f64)) -> f64| {
        let ends = points.clone().map(of).fold([f64::MAX, f64::MIN], |[low, high], at| [low.min(at), high.max(at)]);
        if ends[0] > ends[1] { [-1.0, 1.0] } else { ends }
    };
    let (x, y) = (range(|point| point.0), range(|point| point.1));
    let dots = [f64::from(area.width) * 2.0, f64::from(area.height) * 4.0];
    let per_dot_m = ((x[1] - x[0] + 1.0) / dots[0]).max((y[1] - y[0] + 1.0) / dots[1]);
    let around = |range: [f64; 2], dots: f64| {
        let (middle, half) = ((range[0] + range[1]) / 2.0, per_dot_m * dots / 2.0);
        [middle - half, middle + half]
    };
    [around(x, dots[0]), around(y, dots[1])]
}

/// Reads scans and poses on the node of the tool.
pub(super) struct MapReader {
    poses: StreamReader,
    scans: StreamReader,
    body: Vec<u8>,
}

impl MapReader {
    /// Opens the first stream of each type that a module of this node describes.
    ///
    /// # Errors
    /// What is missing, for the screen.
    pub(super) fn open(running: &Running) -> Result<Self, String> {
        let participant = Participant::join(&running.node, rohrpost::Name::NONE).map_err(|error| error.to_string())?;
        let open = |ty: Type, what: &str| {
            let id = stream_of(running, &ty)
                .ok_or_else(|| format!("no map: no module of node {} writes a stream of {what}", running.node_name))?;
            participant.stream_reader(id).map_err(|error| error.to_string())
        };
        let poses = open(Odometry::schema(), "Odometry")?;
        let mut reader = Self { poses, scans: open(LaserScan::schema(), "LaserScan")?, body: Vec::new() };
        // What is still in the rings is the beginning of the map.
        reader.poses.seek(0);
        reader.scans.seek(0);
        Ok(reader)
    }

    /// Takes what came since the last look.
    pub(super) fn read(&mut self, page: &mut MapPage) {
        let Self { poses, scans, body } = self;
        each(poses, body, |stamp_ns, bytes| {
            if let Ok(odometry) = from_bytes::<Odometry>(bytes) {
                page.at(stamp_ns, odometry.pose);
            }
        });
        each(scans, body, |stamp_ns, bytes| {
            if let Ok(scan) = from_bytes::<LaserScan>(bytes) {
                page.seen(stamp_ns, &scan);
            }
        });
    }
}

/// Records of one look; a writer that is quicker goes on in the next one.
const RECORDS_MAX: usize = 1_000;

fn each(reader: &mut StreamReader, body: &mut Vec<u8>, mut take: impl FnMut(u64, &[u8])) {
    for _ in 0..RECORDS_MAX {
        match reader.try_next_into(body) {
            Ok(Next::Record(record)) => take(record.stamp.ns, body),
            Ok(Next::Lost(_)) => {}
            Ok(Next::Nothing) | Err(_) => return,
        }
    }
}

fn stream_of(running: &Running, ty: &Type) -> Option<StreamId> {
    let names = running.installation.modules.iter().flat_map(|module| module.names());
    let own = names.filter(|name| running.is_own(*name));
    own.filter_map(|name| {
        let description = noted(&running.node, name)?;
        let is_it = |item: &&rohrpost::schema::DataItem| item.kind == DataKind::Stream && item.field.ty == *ty;
        let number = description.data.iter().find(is_it)?.number;
        Some(StreamId { name, number })
    })
    .next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(page: &MapPage, width: u16, height: u16) -> String {
        let area = Rect::new(0, 0, width, height);
        let mut buffer = Buffer::empty(area);
        page.draw(area, &mut buffer, false);
        let line = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(line).collect::<Vec<_>>().join("\n")
    }

    fn scan(ranges_m: Vec<f32>) -> LaserScan {
        LaserScan { start_rad: 0.0, step_rad: std::f32::consts::FRAC_PI_2, range_max_m: 10.0, ranges_m, pose: None }
    }

    #[test]
    fn hits_stand_where_the_robot_was_at_their_time() {
        let mut page = MapPage::default();
        page.seen(5, &scan(vec![1.0]));
        assert!(page.walls.is_empty(), "nobody knows from where");
        page.at(10, Pose { x_m: 1.0, y_m: 2.0, heading_rad: 0.0 });
        page.at(20, Pose { x_m: 3.0, y_m: 2.0, heading_rad: std::f64::consts::FRAC_PI_2 });
        page.seen(11, &scan(vec![1.05, 10.0, f32::NAN]));
        assert_eq!(page.walls.iter().collect::<Vec<_>>(), [&(20, 20)], "beyond its range it saw nothing");
        page.seen(19, &scan(vec![1.05]));
        assert!(page.walls.contains(&(30, 30)) && page.walls.len() == 2, "{:?}", page.walls);
        assert_eq!(page.way, [(1.0, 2.0), (3.0, 2.0)]);
    }

    #[test]
    fn a_map_keeps_its_shape_at_every_size() {
        let mut page = MapPage::default();
        assert_eq!(drawn(&page, 0, 0), "");
        page.at(1, Pose { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 });
        page.seen(1, &scan(vec![4.0, 4.0, 4.0, 4.0]));
        for (width, height) in [(1, 1), (20, 3), (3, 20), (80, 24)] {
            let text = drawn(&page, width, height);
            assert_eq!(text.lines().count(), usize::from(height), "{text}");
            assert!(text.contains('@'), "{width} x {height}:\n{text}");
        }
        let [x, y] = bounds([(0.0, 0.0), (10.0, 1.0)].iter(), Rect::new(0, 0, 40, 20));
        assert!(((x[1] - x[0]) / 80.0 - (y[1] - y[0]) / 80.0).abs() < 1e-9, "a metre is as long both ways");
        page.at(2, Pose { x_m: f64::NAN, y_m: 1e300, heading_rad: 0.0 });
        assert!(drawn(&page, 40, 10).contains('@'), "a broken pose is left out");
    }
}
