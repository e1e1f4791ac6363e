//! The seed's own algorithm in the model of teams: it goes round in a circle.

use crate::cores::real::team_model::Teams;
use crate::cores::real::team_model::bounds::{Bounds, Loss, Store, Story};
use crate::cores::real::team_model::key::Key;
use crate::cores::real::team_model::world::{BEAT_NS, Robot, State, Step};
use crate::seed_algorithm::{Message, Seed};
use stateright::{Checker, HasDiscoveries, Model, Property};

/// ROBOT_MAX_AGE, beats.
const MAX_AGE: u64 = 3;
const CIRCLE: &str = "no beat of robots that disagree ends as it began";

impl Robot for Seed {
    type Message = Message;
    const ANSWERS: bool = true;
    // The least id leads, and says so to the others.
    const ARE_ALIKE: bool = false;

    fn restarted(&self, _: Store) -> Self {
        Self::new(self.id, self.id, self.id)
    }

    fn beat(&mut self, now_ns: u64) -> Vec<Message> {
        Self::beat(self, now_ns / BEAT_NS, MAX_AGE);
        vec![self.hello()]
    }

    fn hear(&mut self, now_ns: u64, message: &Message) -> Option<Message> {
        Self::hear(self, now_ns / BEAT_NS, message)
    }

    fn may_be_lost(_: &Message, loss: Loss) -> bool {
        loss == Loss::Anything
    }

    fn incarnation(&self) -> u32 {
        0
    }

    fn key(&self, now_ns: u64, key: &mut Key) {
        let age = |(robot, heard): (&u8, &u64)| (*robot, now_ns / BEAT_NS - heard);
        key.hash(&(self.id, Self::pair(self), self.robots.iter().map(age).collect::<Vec<_>>(), &self.objects));
    }

    fn message_key(message: &Message, key: &mut Key) {
        key.hash(message);
    }

    fn broken(_: &Step<'_, Self>) -> Vec<&'static str> {
        Vec::new()
    }

    fn properties(_: Bounds) -> Vec<Property<Teams<Self>>> {
        vec![Property::always(CIRCLE, |model: &Teams<Self>, state: &State<Self>| {
            state.round == model.first.round || state.computed_key(0) != model.first.computed_key(0)
        })]
    }
}

/// CE1 of the digest, 5.1: nothing is lost, and the same states come again in each beat.
#[test]
fn the_seeds_algorithm_goes_round_in_a_circle_for_ever() {
    let mut robots = [Seed::new(1, 1, 3), Seed::new(2, 1, 2), Seed::new(3, 1, 3)];
    for robot in &mut robots {
        robot.robots = [1, 2, 3].into_iter().filter(|other| *other != robot.id).map(|other| (other, 0)).collect();
    }
    let left = Bounds { story: Story::Nothing, may_lose: Loss::Nothing, may_delay: false, may_die: false, calm_max: 2 };
    let model = Teams { first: State::new(robots, 0, 1, left) };
    let checker = model.checker().finish_when(HasDiscoveries::AnyFailures).spawn_bfs().join();
    println!("seed: {} states by {} steps", checker.unique_state_count(), checker.state_count());
    let path = checker.discovery(CIRCLE).expect("a beat that ends as it began");
    println!("round in a circle: {:?}", path.into_actions());
}
