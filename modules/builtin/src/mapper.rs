//! `mapper`: draws a map from scans and poses.

mod poses;

use super::settings::{self, Called, RefusedSetting, Settings as _};
use poses::{NoPose, Poses};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{Cartographer, CartographerInterface, LaserInterface, MapCounts, WheelsInterface};
use rohrpost_modules::runtime::{
    Context, ContextError, Moment, Rate, Received, StreamSubscription, Subscription, Unreadable,
};
use rohrpost_modules::types::{LaserScan, Pose};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::grid::{Mapper, Settings as GridSettings, TileIndex};
use serde::Deserialize;
use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

/// Scans that wait for odometry are looked at so often, at least.
const TICK: Duration = Duration::from_millis(100);
/// Changed patches are published every so many ticks, at most so many at a time: a large change comes in pieces.
const TICKS_BETWEEN_PATCHES: u32 = 5;
const PATCHES_AT_ONCE: usize = 16;
/// Scans that wait for odometry younger than themselves.
const WAITING_MAX: usize = 256;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Settings {
    laser: String,
    odometry: String,
    #[serde(default = "resolution_m")]
    resolution_m: f64,
    #[serde(default)]
    pose_from: PoseFrom,
}

/// Where a scan's pose comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PoseFrom {
    /// From the scan, if it brings one (of a log that was corrected afterwards); else from odometry.
    #[default]
    Scan,
    /// Always from odometry at the time of the scan.
    Odometry,
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        if (0.005..=1.0).contains(&self.resolution_m) {
            return Ok(());
        }
        Err(RefusedSetting { key: "resolution-m", why: format!("is {}; use 0.005 to 1", self.resolution_m) })
    }

    fn calls(&self) -> Vec<Called<'_>> {
        vec![
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
            Called { key: "odometry", module: &self.odometry, class: WheelsInterface::CLASS },
        ]
    }
}

fn resolution_m() -> f64 {
    GridSettings::default().resolution_m
}

pub(super) struct MapModule {
    scans: Scans,
    poses: Poses,
    pose_from: PoseFrom,
    settings: GridSettings,
    map: Mapper,
    waiting: VecDeque<WaitingScan>,
    unpublished: BTreeSet<TileIndex>,
    ticks: u32,
    counts: MapCounts,
}

/// How scans come.
enum Scans {
    /// From the stream of a module on this node.
    Stream(StreamSubscription<LaserScan>),
    /// From another node, in packages.
    Packages(Subscription<LaserScan>),
}

/// A scan with a pose that is not known yet.
struct WaitingScan {
    moment: Moment,
    stamp_ns: u64,
    scan: LaserScan,
}

impl Scans {
    fn subscribe(context: &mut Context, laser: &str) -> Result<Self, ContextError> {
        match context.subscribe_stream(LaserInterface::SCAN, laser) {
            Ok(stream) => Ok(Self::Stream(stream)),
            Err(ContextError::FarStream { .. }) => {
                context.subscribe(LaserInterface::SCAN.data(), laser, Rate::Each).map(Self::Packages)
            }
            Err(error) => Err(error),
        }
    }

    fn read(&self, data: &Received<'_>) -> Result<Option<LaserScan>, Unreadable> {
        match self {
            Self::Stream(stream) => data.read(stream),
            Self::Packages(packages) => data.read(packages),
        }
    }
}

impl Module for MapModule {
    type Settings = Settings;
    type Interfaces = CartographerInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let scans = Scans::subscribe(context, &settings.laser)?;
        let poses = Poses::open(context, &settings.odometry)?;
        settings.check()?;
        let pose_from = settings.pose_from;
        let settings = GridSettings { resolution_m: settings.resolution_m, ..GridSettings::default() };
        context.set_period(TICK);
        Ok(Self {
            scans,
            poses,
            pose_from,
            settings,
            map: Mapper::new(settings),
            waiting: VecDeque::with_capacity(WAITING_MAX),
            unpublished: BTreeSet::new(),
            ticks: 0,
            counts: MapCounts::default(),
        })
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if let Some(scan) = self.scans.read(data)? {
            self.counts.scans += 1;
            let (moment, stamp_ns) = (self.poses.moment(data), data.head.stamp_ns);
            self.waiting.push_back(WaitingScan { moment, stamp_ns, scan });
        } else {
            self.poses.take(data)?;
        }
        self.work_off(context)
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.work_off(context)?;
        self.ticks = self.ticks.wrapping_add(1);
        if self.ticks.is_multiple_of(TICKS_BETWEEN_PATCHES) { self.publish_patches(context) } else { Ok(()) }
    }
}

impl MapModule {
    /// Maps the scans with known poses.
    fn work_off(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        while let Some(WaitingScan { moment, stamp_ns, scan }) = self.waiting.front() {
            let pose = match scan.pose.filter(|_| self.pose_from == PoseFrom::Scan) {
                Some(pose) => Ok(pose),
                None => self.poses.at(*moment),
            };
            match pose {
                Err(NoPose::NotYet) if self.waiting.len() < WAITING_MAX => break,
                Err(_) => self.counts.without_pose += 1,
                Ok(pose) => {
                    self.counts.mapped += u64::from(self.map.integrate(scan, &pose).is_ok());
                    context.publish::<Pose>(CartographerInterface::POSE, *stamp_ns, &pose)?;
                }
            }
            self.waiting.pop_front();
        }
        Ok(())
    }

    fn publish_patches(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.unpublished.extend(self.map.take_changed());
        for _ in 0..PATCHES_AT_ONCE {
            let Some(index) = self.unpublished.pop_first() else { break };
            if let Some(patch) = self.map.tile(index) {
                context.publish_now(CartographerInterface::MAP, &patch)?;
            }
        }
        Ok(())
    }
}

impl Cartographer for MapModule {
    fn counts(&mut self) -> MapCounts {
        let cells = self.map.counts();
        MapCounts { odometries: self.poses.count(), free: cells.free, occupied: cells.occupied, ..self.counts }
    }

    fn publish_all(&mut self) {
        self.unpublished.extend(self.map.tiles());
    }

    fn clear(&mut self) {
        self.map = Mapper::new(self.settings);
        self.unpublished.clear();
    }
}
