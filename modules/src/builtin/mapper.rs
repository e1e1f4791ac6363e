//! `mapper`: draws a map from scans and poses.

use super::settings::{self, Called, RefusedSetting, Settings as _};
use crate::interface::Interface;
use crate::interfaces::{Cartographer, CartographerInterface, LaserInterface, MapCounts, WheelsInterface};
use crate::module::{Module, ModuleError};
use crate::robot::grid::{Mapper, Settings as GridSettings, TileIndex};
use crate::runtime::{Context, Rate, Received, Subscription};
use crate::types::{LaserScan, Odometry, Pose};
use rohrpost_fusion::{History, NoValue, Records as _, Refused, Stamp};
use serde::Deserialize;
use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

/// Changed patches are published so often, at most so many at a time, so that a large change comes in pieces.
const TICK: Duration = Duration::from_millis(500);
const PATCHES_AT_ONCE: usize = 16;
/// Odometry that is kept to find a scan's pose in.
const POSES: usize = 256;
/// Between two poses further apart than this, nobody knows where the robot was.
const GAP_MAX_NS: u64 = 5_000_000_000;
/// Scans that wait for odometry younger than themselves.
const WAITING_MAX: usize = 32;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Settings {
    laser: String,
    odometry: String,
    #[serde(default = "resolution_m")]
    resolution_m: f64,
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
    laser: Subscription<LaserScan>,
    odometry: Subscription<Odometry>,
    settings: GridSettings,
    map: Mapper,
    poses: History<Pose>,
    /// Counts the times that odometry's stamps went back: time was set, or the base was restarted.
    epoch: u64,
    waiting: VecDeque<(Stamp, LaserScan)>,
    unpublished: BTreeSet<TileIndex>,
    counts: MapCounts,
}

impl Module for MapModule {
    type Settings = Settings;
    type Interfaces = CartographerInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let laser = context.subscribe(LaserInterface::SCAN, &settings.laser, Rate::Each)?;
        let odometry = context.subscribe(WheelsInterface::ODOMETRY, &settings.odometry, Rate::Each)?;
        settings.check()?;
        let settings = GridSettings { resolution_m: settings.resolution_m, ..GridSettings::default() };
        context.set_period(TICK);
        Ok(Self {
            laser,
            odometry,
            settings,
            map: Mapper::new(settings),
            poses: History::new(POSES, 0),
            epoch: 0,
            waiting: VecDeque::with_capacity(WAITING_MAX),
            unpublished: BTreeSet::new(),
            counts: MapCounts::default(),
        })
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if let Some(odometry) = data.read(&self.odometry)? {
            self.counts.odometries += 1;
            self.remember(data.head.stamp_ns, odometry.pose);
        } else if let Some(scan) = data.read(&self.laser)? {
            self.counts.scans += 1;
            self.waiting.push_back((Stamp::new(self.epoch, data.head.stamp_ns), scan));
        }
        self.work_off(context)
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
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

impl MapModule {
    fn remember(&mut self, stamp_ns: u64, pose: Pose) {
        let sequence = self.counts.odometries;
        let taken = self.poses.push(Stamp::new(self.epoch, stamp_ns), sequence, pose);
        if let Err(Refused::Late { .. }) = taken {
            // Earlier poses, and scans that wait for one of them, are of no use now.
            self.epoch += 1;
            let first = self.poses.push(Stamp::new(self.epoch, stamp_ns), sequence, pose);
            debug_assert_eq!(first, Ok(()), "an epoch takes its first record");
        }
    }

    /// Maps the scans with known poses.
    fn work_off(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        while let Some((stamp, scan)) = self.waiting.front() {
            let pose = match scan.pose {
                Some(pose) => Ok(pose),
                None => self.poses.at(*stamp, GAP_MAX_NS),
            };
            match pose {
                Err(NoValue::NotYet { .. } | NoValue::Empty) if self.waiting.len() < WAITING_MAX => break,
                Err(_) => self.counts.without_pose += 1,
                Ok(pose) => {
                    self.counts.mapped += u64::from(self.map.integrate(scan, &pose).is_ok());
                    let stamp_ns = stamp.ns;
                    context.publish::<Pose>(CartographerInterface::POSE, stamp_ns, &pose)?;
                }
            }
            self.waiting.pop_front();
        }
        Ok(())
    }
}

impl Cartographer for MapModule {
    fn counts(&mut self) -> MapCounts {
        let cells = self.map.counts();
        MapCounts { free: cells.free, occupied: cells.occupied, ..self.counts }
    }

    fn publish_all(&mut self) {
        self.unpublished.extend(self.map.tiles());
    }

    fn clear(&mut self) {
        self.map = Mapper::new(self.settings);
        self.unpublished.clear();
    }
}
