//! How a robot is drawn, but for its place: it changes seldom, its place often.

use super::known::{Doing, KnownRobot};
use crate::palette::Rgb;

/// Radius of a body of which none is told, m.
pub(super) const RADIUS_M: f32 = 0.25;
/// Greatest radius that is believed, m.
const RADIUS_MAX_M: f32 = 10.0;
const SECOND_NS: u64 = 1_000_000_000;

/// See the module's text.
#[derive(PartialEq, Debug)]
pub(crate) struct Look {
    pub(super) radius_m: f32,
    pub(super) colour: Rgb,
    pub(super) doing: Option<Doing>,
    pub(super) is_leader: bool,
    /// The robot believes to be elsewhere, and so is drawn there, too.
    pub(super) is_mistaken: bool,
    pub(super) label: String,
}

impl Look {
    pub(super) fn of(id: u8, robot: &KnownRobot, now_ns: u64) -> Self {
        let doing = robot.doing(now_ns);
        let radius_m =
            robot.body.map(|body| body.radius_m as f32).filter(|radius_m| (0.01..RADIUS_MAX_M).contains(radius_m));
        Self {
            radius_m: radius_m.unwrap_or(RADIUS_M),
            colour: robot.colour(now_ns),
            doing,
            is_mistaken: robot.mistaken().is_some(),
            is_leader: robot.group(now_ns).is_some_and(|(_, leader)| leader == id),
            label: format!("{id}{}", remark(doing, robot, now_ns)),
        }
    }
}

/// What a person should know of a robot besides its number.
fn remark(doing: Option<Doing>, robot: &KnownRobot, now_ns: u64) -> String {
    match doing {
        Some(Doing::Silent) => format!(", silent for {} s", robot.silent_ns(now_ns).unwrap_or_default() / SECOND_NS),
        Some(doing @ (Doing::Lost | Doing::WormholeDrives | Doing::NobodyDrives)) => format!(", {}", doing.word()),
        Some(Doing::Mode(_)) | None => String::new(),
    }
}
