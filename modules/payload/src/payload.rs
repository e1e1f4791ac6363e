//! One robot's program.

use crate::event::{Event, Types};
use crate::ground::{Ground, position};
use crate::journey::Navigation;
use crate::mode::Mode;
use crate::request::{Report, Request};
use crate::settings::{RefusedSettings, Settings};
use crate::state::{Fix, LostCause, News, Seen, State};
use crate::tree;
use rohrpost_modules::types::{LaserScan, Pose};
use rohrpost_robot::lookout::Lookout;
use rohrpost_supervision::{Command, Order, Promise};
use rohrpost_team::coordination::{Sharing, Traffic, TrafficMessage};
use rohrpost_team::events::{EventHead, LossCause, Priority, Refused, Tree};
use rohrpost_team::grid::Cell;
use rohrpost_team::group::Hello;
use rohrpost_team::view::Records;
use rohrpost_team::{Malformed, RobotId, Team, TeamSettings};
use std::sync::Arc;

/// What the robot's sensors say at one moment.
#[derive(Clone, Debug)]
pub struct Sensed {
    /// Where the robot is on its map; `None` if that is not known.
    pub pose: Option<Pose>,
    /// Forward, metres a second.
    pub speed_m_s: f64,
    /// What it sees from there.
    pub scan: LaserScan,
}

/// Why a message was not taken. Nothing else follows from it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NotHeard {
    /// No message of a team.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// An event of another tree.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The payload of an event is none of its type.
    #[error("event of type {0} of robot {1} carries what such events do not carry")]
    Payload(u8, RobotId),
    /// The first byte names no kind of message.
    #[error("a message begins with `H`, `R`, `E` or `T`")]
    Kind,
}

/// See the crate's head. Times are ns of the robot's own monotonic clock.
pub struct Payload {
    tree: Tree<State, Event>,
    types: Types,
    state: State,
    order: Order,
}

impl Payload {
    /// A robot that starts. For `max_age` of its group it only listens: before it knows its friends, what it sees may
    /// be any of them. `incarnation` is one more than the stored one; `seed` is of what it decides by chance.
    ///
    /// # Errors
    /// The first mistake of the settings.
    ///
    /// # Panics
    /// If its own tree is none, which no input changes.
    pub fn new(
        now_ns: u64,
        me: RobotId,
        incarnation: u32,
        ground: Arc<Ground>,
        settings: Settings,
        team: TeamSettings,
        seed: u64,
    ) -> Result<Self, RefusedSettings> {
        settings.check()?;
        let (tree, types) = tree::plant().expect("the tree is the same at each start");
        let (friend_max_age_ns, listens_ns) = (team.view.friend_max_age_ns, team.group.max_age_ns);
        let map = ground.digest;
        let traffic = settings.coordination.map(|times| Traffic::new(me, incarnation, map, times, now_ns));
        let mut team = Team::new(me, incarnation, ground.digest, team);
        team.set_tree(tree.short_digest());
        let state = State {
            settings,
            ground,
            team,
            traffic,
            friend_max_age_ns,
            listens_until_ns: now_ns.saturating_add(listens_ns),
            fix: None,
            seen: None,
            lost: Some(LostCause::NoPose),
            no_way: None,
            mode: Mode::default(),
            is_obstructed: false,
            navigation: Navigation::new(seed ^ u64::from(me.get())),
            outbox: Vec::new(),
            command: None,
            news: Vec::new(),
            refused: None,
            quit_beats: None,
        };
        Ok(Self { tree, types, state, order: Order { incarnation, sequence: 0 } })
    }

    /// The beat, twice a second or as the team's settings say.
    pub fn beat(&mut self, now_ns: u64) {
        self.state.quit_beats = self.state.quit_beats.map(|beats| beats.saturating_sub(1));
        self.tree.hard(self.types.beat, Event::Beat);
        self.run(now_ns);
    }

    /// What the sensors say now; to be called several times in each promise.
    pub fn sense(&mut self, now_ns: u64, Sensed { pose, speed_m_s, scan }: Sensed) {
        self.state.is_obstructed = false;
        if let Some(pose) = pose {
            self.state.fix = Some(Fix { pose, speed_m_s, at_ns: now_ns });
            let obstacles = self.obstacles(pose, &scan);
            if !obstacles.is_empty() {
                self.tree.hard(self.types.obstacle, Event::Obstacle(obstacles.clone()));
            }
            self.state.seen = Some(Seen { scan, pose, at_ns: now_ns, obstacles });
        }
        self.tree.hard(self.types.pose, Event::Pose);
        self.run(now_ns);
    }

    /// Middles of what stands before the walls of the map.
    fn obstacles(&self, pose: Pose, scan: &LaserScan) -> Vec<rohrpost_team::Position> {
        let Settings { error_m, gate_m, intruder_radius_m, .. } = self.state.settings;
        let lookout = Lookout { world: &self.state.ground.world, pose, scan, error_m };
        let middle = |(x_m, y_m): (f64, f64)| {
            let (ahead_m, aside_m) = (x_m - pose.x_m, y_m - pose.y_m);
            let share = intruder_radius_m / ahead_m.hypot(aside_m).max(intruder_radius_m);
            position(x_m + share * ahead_m, y_m + share * aside_m)
        };
        lookout.obstacles(gate_m).into_iter().filter_map(middle).collect()
    }

    /// A message of a teammate came.
    ///
    /// # Errors
    /// Why it was not taken.
    pub fn hear(&mut self, now_ns: u64, message: &[u8]) -> Result<(), NotHeard> {
        match message.first() {
            Some(b'H') => {
                self.tree.hard(self.types.heard, Event::Hello(Box::new(Hello::decode(message)?)));
            }
            Some(b'R') => {
                let records = Box::new(Records::decode(message)?);
                let event_type = if records.is_synchro { self.types.synchro } else { self.types.heard };
                self.tree.hard(event_type, Event::Records(records));
            }
            Some(b'E') => {
                let (head, bytes) = EventHead::decode(message)?;
                let event = Event::decode(&head, bytes, self.types);
                self.tree.hear(&head, event.ok_or(NotHeard::Payload(head.event_type, head.from))?)?;
            }
            Some(b'T') => {
                let message = Box::new(TrafficMessage::decode(message)?);
                self.tree.hard(self.types.traffic, Event::Traffic(message));
            }
            _ => return Err(NotHeard::Kind),
        }
        self.run(now_ns);
        Ok(())
    }

    /// A person at this station asks something of mobiles.
    pub fn ask(&mut self, now_ns: u64, request: Request) {
        self.tree.hard(self.types.command, Event::Request(request));
        self.run(now_ns);
    }

    /// A person or program at this robot has a text for stations.
    pub fn say(&mut self, now_ns: u64, text: String) {
        self.tree.hard(self.types.command, Event::Report(Report { answers: None, text }));
        self.run(now_ns);
    }

    /// Runs leaves until nothing waits: the tree has no cycles.
    fn run(&mut self, now_ns: u64) {
        while self.tree.dispatch(now_ns, &mut self.state) {}
        let me = self.state.team.group().me();
        while let Some((head, event)) = self.tree.take_sent(me) {
            if let Some(bytes) = event.encode() {
                self.state.outbox.push([&head.encode()[..], &bytes].concat());
            }
        }
    }

    /// Messages to all teammates since the last call, in this order.
    pub fn take_messages(&mut self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.state.outbox)
    }

    /// The promise to the wormhole, if there is a new one.
    pub fn take_promise(&mut self) -> Option<Promise> {
        let command = self.state.command.take()?;
        // A robot that is about to end stands.
        let command = if self.state.quit_beats.is_some() { Command::STOP } else { command };
        self.order.sequence = self.order.sequence.wrapping_add(1);
        Some(Promise { order: self.order, duration_ns: self.state.settings.promise_ns, command })
    }

    /// What people should know since the last call.
    pub fn take_news(&mut self) -> Vec<News> {
        std::mem::take(&mut self.state.news)
    }

    /// What the robot does.
    pub fn mode(&self) -> Mode {
        self.state.mode
    }

    /// Why the robot is lost, if it is.
    pub fn lost(&self) -> Option<LostCause> {
        self.state.lost
    }

    /// The middle of the cell to which the robot's way leads, metres; `None` without such a place.
    pub fn destination_m(&self) -> Option<(f64, f64)> {
        let (cell, _) = self.state.navigation.destination?;
        Some(self.state.ground.placement.middle_m(&self.state.ground.grid, cell))
    }

    /// Where the robot is, as its sensors said last; `None` before the first pose.
    pub fn pose(&self) -> Option<Pose> {
        self.state.fix.map(|fix| fix.pose)
    }

    /// The cell in which the robot is; `None` while it is lost.
    pub fn cell(&self) -> Option<Cell> {
        self.state.cell()
    }

    /// Cells to which it goes, as far as they are planned: the next one first.
    pub fn way(&self) -> Vec<Cell> {
        match &self.state.traffic {
            Some(traffic) => traffic.way(),
            None => self.state.navigation.next.into_iter().collect(),
        }
    }

    /// The floor on which it drives.
    pub fn ground(&self) -> &Ground {
        &self.state.ground
    }

    /// What robots do about intruders, and exits that nobody holds; `None` without intruder, plan or coordination.
    pub fn sharing(&self) -> Option<&Sharing> {
        self.state.traffic.as_ref().and_then(Traffic::sharing)
    }

    /// How many events of a priority waited for leaves at a time at most.
    pub fn queued_most(&self, priority: Priority) -> usize {
        self.tree.queued_most(priority)
    }

    /// Events that were lost because their queues were full.
    pub fn events_lost(&self) -> u64 {
        self.types.all().map(|it| self.tree.lost(it, LossCause::QueueFull)).sum()
    }

    /// What it knows of its team.
    pub fn team(&self) -> &Team {
        &self.state.team
    }

    pub(crate) fn team_mut(&mut self) -> &mut Team {
        &mut self.state.team
    }

    /// Whether it is to end now: a station has told it some beats ago, in which it has acknowledged that.
    pub fn has_quit(&self) -> bool {
        self.state.quit_beats == Some(0)
    }
}
