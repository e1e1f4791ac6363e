//! Where the robot was at a time, by its odometry: looked up in the stream of a module on this node, or, if that is on
//! another node, in what came from there.

use rohrpost_modules::fusion::{History, NoValue, Records as _, Refused, Stamp};
use rohrpost_modules::interfaces::WheelsInterface;
use rohrpost_modules::runtime::{Context, ContextError, Moment, Rate, Received, Stream, Subscription, Unreadable};
use rohrpost_modules::types::{Odometry, Pose};
use std::time::Duration;

/// Between two records further apart than this, nobody knows where the robot was.
const GAP_MAX: Duration = Duration::from_secs(5);
/// Odometry of another node that is kept.
const KEPT: usize = 256;
/// A package that is less behind the newest one was late; one that is more behind begins another time.
const BEHIND_MAX_NS: u64 = 1_000_000_000;

/// Odometry.
pub(super) enum Poses {
    /// In its stream.
    Near(Box<Near>),
    /// In packages from another node.
    Far(Subscription<Odometry>, Far),
}

/// There is no pose for a time.
pub(super) enum NoPose {
    /// A later record is needed.
    NotYet,
    /// There will be none.
    Never,
}

pub(super) struct Near {
    stream: Stream<Odometry>,
    /// Sequence of the first record that counts.
    first: u64,
    /// The last error that was told.
    told: Option<String>,
}

pub(super) struct Far {
    poses: History<Pose>,
    /// Counts the times that stamps went back: time was set, or the base was restarted.
    epoch: u64,
    /// Packages that came.
    came: u64,
}

impl Poses {
    pub(super) fn open(context: &mut Context, odometry: &str) -> Result<Self, ContextError> {
        match context.stream(WheelsInterface::ODOMETRY, odometry) {
            Ok(stream) => {
                let first = stream.position();
                Ok(Self::Near(Box::new(Near { stream: stream.with_gap(GAP_MAX), first, told: None })))
            }
            Err(ContextError::FarStream { .. }) => {
                let packages = context.subscribe(WheelsInterface::ODOMETRY.data(), odometry, Rate::Each)?;
                Ok(Self::Far(packages, Far::new()))
            }
            Err(error) => Err(error),
        }
    }

    /// When something was true, in the time that [`Poses::at`] knows.
    pub(super) fn moment(&self, data: &Received<'_>) -> Moment {
        match self {
            Self::Near(_) => data.moment(),
            Self::Far(_, far) => rohrpost_mailbox::Stamp { epoch: far.epoch, ns: data.head.stamp_ns }.into(),
        }
    }

    /// Takes odometry that came in a package.
    pub(super) fn take(&mut self, data: &Received<'_>) -> Result<(), Unreadable> {
        if let Self::Far(packages, far) = self
            && let Some(odometry) = data.read(packages)?
        {
            far.take(data.head.stamp_ns, odometry.pose);
        }
        Ok(())
    }

    /// The pose at a time.
    pub(super) fn at(&mut self, moment: Moment) -> Result<Pose, NoPose> {
        let found = match self {
            Self::Near(near) => near.at(moment)?,
            Self::Far(_, far) => far.at(moment),
        };
        found.map_err(|none| match none {
            NoValue::NotYet { .. } | NoValue::Empty => NoPose::NotYet,
            never => {
                tracing::debug!("a scan without a pose: {never}");
                NoPose::Never
            }
        })
    }

    /// How much odometry there was since the start.
    pub(super) fn count(&mut self) -> u64 {
        match self {
            Self::Near(near) => near.count(),
            Self::Far(_, far) => far.came,
        }
    }
}

impl Near {
    fn at(&mut self, moment: Moment) -> Result<Result<Pose, NoValue>, NoPose> {
        match self.stream.at(moment) {
            Ok(found) => {
                self.told = None;
                Ok(found.map(|odometry| odometry.pose))
            }
            Err(error) => {
                let text = error.to_string();
                if self.told.as_ref() != Some(&text) {
                    tracing::warn!("scans have no pose: {text}");
                    self.told = Some(text);
                }
                Err(NoPose::Never)
            }
        }
    }

    fn count(&mut self) -> u64 {
        // What cannot be read is told when a pose is asked for.
        let newest = self.stream.newest().ok().flatten();
        newest.map_or(0, |newest| (newest.info().sequence + 1).saturating_sub(self.first))
    }
}

impl Far {
    fn new() -> Self {
        Self { poses: History::new(KEPT, 0), epoch: 0, came: 0 }
    }

    fn take(&mut self, stamp_ns: u64, pose: Pose) {
        self.came += 1;
        let is_another_time =
            self.poses.newest().is_some_and(|newest| newest.stamp.ns.saturating_sub(stamp_ns) > BEHIND_MAX_NS);
        // Earlier poses, and scans that wait for one of them, are of no use then.
        self.epoch += u64::from(is_another_time);
        match self.poses.push(Stamp::new(self.epoch, stamp_ns), self.came, pose) {
            Ok(()) => {}
            Err(Refused::Late { .. }) => tracing::debug!("odometry that came late"),
            Err(refused) => tracing::warn!("odometry is left out: {refused}"),
        }
    }

    fn at(&self, moment: Moment) -> Result<Pose, NoValue> {
        let stamp = match moment {
            Moment::Stamp(stamp) => Stamp::new(stamp.epoch, stamp.ns),
            Moment::Ns(ns) => Stamp::new(self.epoch, ns),
        };
        self.poses.at(stamp, GAP_MAX.as_nanos() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    /// Odometry that says where it was by its time: x in metres is the stamp in tenths of a second.
    fn came(stamps_ds: &[u64]) -> Far {
        let mut far = Far::new();
        for ds in stamps_ds {
            far.take(100 * S + ds * S / 10, Pose { x_m: *ds as f64, ..Pose::default() });
        }
        far
    }

    #[test]
    fn a_late_package_is_left_out_and_another_time_begins_anew() {
        for (stamps_ds, epoch, asked_ds, found, why) in [
            (&[10, 20][..], 0, 15, Ok(15.0), "in between"),
            (&[10, 20, 14, 30], 0, 15, Ok(15.0), "what is late changes nothing"),
            (&[10, 20, 14, 30], 0, 25, Ok(25.0), "and what comes after it counts"),
            (&[30, 40, 10, 20], 1, 15, Ok(15.0), "time was set back by 3 s"),
            (&[10, 20], 0, 25, Err(NoValue::NotYet { by_ns: S / 2 }), "younger than all"),
            (&[10, 70], 0, 15, Err(NoValue::Gap { gap_ns: 6 * S, gap_max_ns: 5 * S }), "in a gap"),
        ] {
            let far = came(stamps_ds);
            assert_eq!((far.epoch, far.came), (epoch, stamps_ds.len() as u64), "{why}");
            let stamp = rohrpost_mailbox::Stamp { epoch, ns: 100 * S + asked_ds * S / 10 };
            assert_eq!(far.at(stamp.into()).map(|pose| pose.x_m), found, "{why}");
        }
        let stamp = rohrpost_mailbox::Stamp { epoch: 0, ns: 103 * S };
        assert!(matches!(came(&[30, 40, 10]).at(stamp.into()), Err(NoValue::OtherEpoch { .. })), "of the time before");
    }
}
