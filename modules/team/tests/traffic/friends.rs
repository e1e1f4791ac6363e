//! Robots that pass each other are not taken for intruders.

use crate::world::{S_NS, id};
use rohrpost_team::group::{GroupSettings, Pose};
use rohrpost_team::view::ViewSettings;
use rohrpost_team::{Position, Team, TeamSettings};

const SETTINGS: TeamSettings = TeamSettings {
    group: GroupSettings { beat_ns: S_NS / 2, max_age_ns: 4 * S_NS },
    view: ViewSettings {
        gate_mm: 500,
        sightings: 3,
        certainty_max_age_ns: 10 * S_NS,
        intruder_max_age_ns: 60 * S_NS,
        friend_max_age_ns: 30 * S_NS,
        friend_radius_mm: 300,
        speed_max_mm_s: 1000,
    },
    drift_ppb: 50_000,
    clock_off_ns: S_NS,
};

/// One robot stands; another one passes it, tells each beat where it is, and is seen ten times a second.
#[test]
fn a_friend_that_passes_is_no_intruder() {
    let [mut stands, mut passes] = [1, 2].map(|system| Team::new(id(system), 1, 7, SETTINGS));
    for tick in 0..200_u64 {
        let now_ns = S_NS + tick * S_NS / 10;
        let position = Position { x_mm: 1000 - 10 * tick as i32, y_mm: 1000 };
        if tick % 5 == 0 {
            let hello = passes.beat(now_ns, Some(Pose { position, ..Pose::default() })).hello;
            stands.hear_hello(now_ns, &hello);
            passes.hear_hello(now_ns, &stands.beat(now_ns, Some(Pose::default())).hello);
        }
        stands.look(now_ns, &[position], |_| true);
        let objects = stands.view().objects();
        assert!(objects.is_empty(), "a friend that is heard is no intruder: {objects:?}");
    }
}
