//! What all leaves of a payload share.

use crate::ground::Ground;
use crate::journey::Navigation;
use crate::mode::Mode;
use crate::request::{Report, RequestId};
use crate::settings::Settings;
use rohrpost_modules::types::{LaserScan, Pose};
use rohrpost_robot::lookout::Lookout;
use rohrpost_supervision::Command;
use rohrpost_team::coordination::{NoWays, Traffic};
use rohrpost_team::grid::Cell;
use rohrpost_team::view::Object;
use rohrpost_team::{Position, RobotId, Team};
use std::sync::Arc;

/// Scans and poses that are older say nothing of now, ns.
const SEEN_MAX_AGE_NS: u64 = 1_000_000_000;
/// News that wait for people; more are dropped.
const NEWS_MAX: usize = 64;

/// Why a robot is lost.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum LostCause {
    /// None since the start.
    #[error("no pose has come yet")]
    NoPose,
    /// None for too long, ms.
    #[error("no pose came for {0} ms")]
    Old(u64),
    /// The pose is on no path.
    #[error("it is on no path of its map")]
    NoCell,
}

/// What people should know.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum News {
    /// The robot stands, since it does not know its cell.
    Lost(LostCause),
    /// The robot knows its cell again.
    Found(Cell),
    /// From now on it does this.
    Mode(Mode),
    /// The robot has no way to where it should be.
    NoWay(NoWays),
    /// A station has told it to end.
    Quit(RobotId),
    /// A robot that is no station of this team asked for something.
    Refused(RobotId),
    /// A mobile has answered, or has something to say.
    Report {
        /// The mobile.
        from: RobotId,
        /// What it says.
        report: Report,
    },
}

/// Where the robot is, as its sensors say.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fix {
    pub(crate) pose: Pose,
    pub(crate) speed_m_s: f64,
    pub(crate) at_ns: u64,
}

/// A scan, and where the robot was.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    pub(crate) scan: LaserScan,
    pub(crate) pose: Pose,
    pub(crate) at_ns: u64,
    /// Middles of what no wall explains.
    pub(crate) obstacles: Vec<Position>,
}

/// See the module's head.
pub(crate) struct State {
    pub(crate) settings: Settings,
    pub(crate) ground: Arc<Ground>,
    pub(crate) team: Team,
    /// Acts with the others; `None`: each plans for itself.
    pub(crate) traffic: Option<Traffic>,
    /// FRIEND_MAX_AGE of the team.
    pub(crate) friend_max_age_ns: u64,
    /// Until then what it sees is nothing: friends have not told yet where they are.
    pub(crate) listens_until_ns: u64,
    pub(crate) fix: Option<Fix>,
    pub(crate) seen: Option<Seen>,
    pub(crate) lost: Option<LostCause>,
    /// Why it has no way, as was told.
    pub(crate) no_way: Option<NoWays>,
    pub(crate) mode: Mode,
    /// Something is near, in front of the robot.
    pub(crate) is_obstructed: bool,
    pub(crate) navigation: Navigation,
    pub(crate) outbox: Vec<Vec<u8>>,
    pub(crate) command: Option<Command>,
    pub(crate) news: Vec<News>,
    /// The last request that was refused: it is told once.
    pub(crate) refused: Option<RequestId>,
    /// A station has told it to end, after so many beats.
    pub(crate) quit_beats: Option<u8>,
}

impl State {
    pub(crate) fn tell(&mut self, news: News) {
        if self.news.len() < NEWS_MAX {
            self.news.push(news);
        }
    }

    /// The cell in which the robot is; `None` while it is lost.
    pub(crate) fn cell(&self) -> Option<Cell> {
        if self.lost.is_some() {
            return None;
        }
        let Pose { x_m, y_m, .. } = self.fix?.pose;
        self.ground.placement.cell(&self.ground.grid, x_m, y_m)
    }

    /// The newest scan, if it is of now.
    pub(crate) fn seen_now(&self, now_ns: u64) -> Option<&Seen> {
        self.seen.as_ref().filter(|seen| now_ns.saturating_sub(seen.at_ns) <= SEEN_MAX_AGE_NS)
    }

    /// Whether something at a place would have been seen.
    pub(crate) fn can_see(&self, now_ns: u64, place: Position) -> bool {
        self.seen_now(now_ns).is_some_and(|seen| {
            let Seen { pose, scan, .. } = seen;
            let lookout = Lookout { world: &self.ground.world, pose: *pose, scan, error_m: self.settings.error_m };
            lookout.can_see(f64::from(place.x_mm) / 1000.0, f64::from(place.y_mm) / 1000.0, self.settings.gate_m)
        })
    }

    /// Cells of intruders of which the place is certain, or of all.
    pub(crate) fn intruders(&self, only_certain: bool) -> Vec<Cell> {
        let objects = self.team.view().objects().into_iter();
        let wanted = objects.filter(|object: &Object| object.certain || !only_certain);
        wanted.filter_map(|object| self.ground.cell_at(object.position)).collect()
    }
}
