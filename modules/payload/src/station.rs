//! A station: where a person sees the team, makes up intruders, and asks mobiles (seed 000, 4.5.3 and A.4).
//!
//! ```text
//!  person ─ set, move, remove ──▶ own records of the view, kind "fake" ──▶ Records ──▶ all robots
//!         ─ ask ──▶ Asked: each robot by name ──▶ Request, each beat, to those that have not answered ──▶ mobiles
//!         ◀─ Asking: waiting ─▶ answered, refused, a station, restarted, given up ◀── Report ──┘
//!         ◀─ Said: texts of mobiles
//! ```
//!
//! The station is a [`Payload`] that has no pose and no share in traffic: it takes part in group, view and time, and
//! never holds an entrance.

use crate::ground::Ground;
use crate::payload::{NotHeard, Payload};
use crate::request::{Answer, Report, Request, RequestId, RequestKind};
use crate::settings::{RefusedSettings, Settings};
use crate::state::News;
use rohrpost_team::view::{Kind, ObjectId};
use rohrpost_team::{Position, RobotId, Run, Team, TeamSettings};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Intruders that a station makes up at one time: fewer than an observer has records, so that none is forgotten.
pub const FAKES_MAX: usize = 24;
/// A robot is asked in so many beats before it is given up.
const TRIES_MAX: u32 = 20;
/// Requests that are remembered; those that wait are never forgotten.
const REQUESTS_MAX: usize = 16;
/// Texts that are remembered.
const SAID_MAX: usize = 100;

/// What a person wants, and cannot be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StationRefusal {
    /// A place off all paths.
    #[error(
        "an intruder cannot be at {} mm, {} mm: that is on no path of the map; name a place on one", .0.x_mm, .0.y_mm
    )]
    NoPath(Position),
    /// As many as there may be.
    #[error("this station has made up {FAKES_MAX} intruders; remove one first")]
    TooMany,
    /// No such intruder of this station.
    #[error("this station has made up no such intruder")]
    NoFake,
    /// Nobody would hear.
    #[error("no robot is heard now; look whether they run, and at `rohrpost net`")]
    Nobody,
    /// One that is asked would not hear.
    #[error("robot {0} is not heard now; look whether it runs, and at `rohrpost net`")]
    NotHeard(RobotId),
    /// Too many requests wait.
    #[error("{REQUESTS_MAX} requests wait for answers; wait until one is answered or given up")]
    Busy,
}

/// How it stands with one robot that is asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Asking {
    /// No answer yet; the robot is asked in each beat.
    Waiting,
    /// The robot does what is asked.
    Done,
    /// The robot does not obey this station.
    Refused,
    /// Another station, which is not meant.
    Station,
    /// The robot was restarted meanwhile; the new run was not asked.
    Restarted,
    /// No answer in time. Whether the robot did what was asked, nobody knows.
    GivenUp,
}

/// A request, robot by robot.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Asked {
    /// Number of the request in this run of the station.
    pub number: u32,
    /// What is asked.
    pub kind: RequestKind,
    /// When it was asked first, ns.
    pub at_ns: u64,
    /// How often it was sent.
    pub tries: u32,
    /// The robots that were asked, and how it stands with each.
    pub robots: BTreeMap<RobotId, (u32, Asking)>,
}

impl Asked {
    /// Whether nobody is waited for.
    pub fn is_over(&self) -> bool {
        self.robots.values().all(|(_, asking)| *asking != Asking::Waiting)
    }
}

/// A text of a mobile.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Said {
    /// The mobile.
    pub from: RobotId,
    /// When it came, ns.
    pub at_ns: u64,
    /// The request that it answers.
    pub answers: Option<u32>,
    /// What it says.
    pub text: String,
}

/// See the module's head. Times are ns of the station's own monotonic clock.
pub struct Station {
    payload: Payload,
    ground: Arc<Ground>,
    newest: u32,
    asked: VecDeque<Asked>,
    said: VecDeque<Said>,
}

impl Station {
    /// A station that starts. `incarnation` is one more than the stored one.
    ///
    /// # Errors
    /// None: the settings of its payload are the same at each start.
    pub fn new(
        now_ns: u64,
        me: RobotId,
        incarnation: u32,
        ground: Arc<Ground>,
        team: TeamSettings,
    ) -> Result<Self, RefusedSettings> {
        let settings = Settings { coordination: None, is_station: true, ..Settings::default() };
        let payload = Payload::new(now_ns, me, incarnation, ground.clone(), settings, team, 0)?;
        Ok(Self { payload, ground, newest: 0, asked: VecDeque::new(), said: VecDeque::new() })
    }

    /// The beat, as robots have it: repeats what is not answered.
    pub fn beat(&mut self, now_ns: u64) {
        self.payload.beat(now_ns);
        for at in 0..self.asked.len() {
            self.repeat(now_ns, at);
        }
        self.sort_news(now_ns);
    }

    /// Asks those that have not answered.
    fn repeat(&mut self, now_ns: u64, at: usize) {
        let group = self.payload.team().group();
        let station = Run { robot: group.me(), incarnation: group.version().incarnation };
        let asked = &mut self.asked[at];
        for (robot, (incarnation, asking)) in &mut asked.robots {
            let is_other = group.run(*robot).is_some_and(|run| run.incarnation != *incarnation);
            if *asking == Asking::Waiting && (is_other || asked.tries >= TRIES_MAX) {
                *asking = if is_other { Asking::Restarted } else { Asking::GivenUp };
            }
        }
        if asked.is_over() {
            return;
        }
        asked.tries += 1;
        let waiting = asked.robots.iter().filter(|(_, (_, asking))| *asking == Asking::Waiting);
        let to = waiting.map(|(robot, (incarnation, _))| Run { robot: *robot, incarnation: *incarnation }).collect();
        let id = RequestId { station, number: asked.number };
        self.payload.ask(now_ns, Request { id, kind: asked.kind, to });
    }

    /// A message of a teammate came.
    ///
    /// # Errors
    /// Why it was not taken.
    pub fn hear(&mut self, now_ns: u64, message: &[u8]) -> Result<(), NotHeard> {
        self.payload.hear(now_ns, message)?;
        self.sort_news(now_ns);
        Ok(())
    }

    fn sort_news(&mut self, now_ns: u64) {
        for news in self.payload.take_news() {
            let News::Report { from, report: Report { answers, text } } = news else { continue };
            match answers {
                Some((id, answer)) => self.answered(now_ns, from, id, answer, text),
                None => self.note(Said { from, at_ns: now_ns, answers: None, text }),
            }
        }
    }

    fn answered(&mut self, now_ns: u64, from: RobotId, id: RequestId, answer: Answer, text: String) {
        if id.station.incarnation != self.payload.team().group().version().incarnation {
            return;
        }
        let asked = self.asked.iter_mut().find(|asked| asked.number == id.number);
        let Some((_, asking)) = asked.and_then(|asked| asked.robots.get_mut(&from)) else { return };
        // An answer that comes late is one, too.
        if !matches!(asking, Asking::Waiting | Asking::GivenUp) {
            return;
        }
        *asking = match answer {
            Answer::Done => Asking::Done,
            Answer::Refused => Asking::Refused,
            Answer::Station => Asking::Station,
        };
        self.note(Said { from, at_ns: now_ns, answers: Some(id.number), text });
    }

    fn note(&mut self, said: Said) {
        if self.said.len() == SAID_MAX {
            self.said.pop_front();
        }
        self.said.push_back(said);
    }

    /// Messages to all teammates since the last call, in this order.
    pub fn take_messages(&mut self) -> Vec<Vec<u8>> {
        self.payload.take_messages()
    }

    /// Makes up an intruder.
    ///
    /// # Errors
    /// Why there is none.
    pub fn set_fake(&mut self, now_ns: u64, position: Position) -> Result<ObjectId, StationRefusal> {
        self.check_place(position)?;
        let own = self.team().view().ledgers().get(&self.team().group().me());
        let records = own.into_iter().flat_map(|ledger| ledger.records.values());
        let fakes = records.filter(|kept| kept.record.kind == Kind::Fake && !kept.record.is_ended());
        if fakes.count() >= FAKES_MAX {
            return Err(StationRefusal::TooMany);
        }
        Ok(self.payload.team_mut().add_fake(now_ns, position))
    }

    /// Moves an intruder that this station has made up.
    ///
    /// # Errors
    /// Why it stays where it was.
    pub fn move_fake(&mut self, now_ns: u64, id: ObjectId, position: Position) -> Result<(), StationRefusal> {
        self.check_place(position)?;
        let moved = self.payload.team_mut().move_fake(now_ns, id, position);
        if moved { Ok(()) } else { Err(StationRefusal::NoFake) }
    }

    /// Removes an intruder that this station has made up.
    ///
    /// # Errors
    /// This station has made up no such one.
    pub fn remove_fake(&mut self, now_ns: u64, id: ObjectId) -> Result<(), StationRefusal> {
        let removed = self.payload.team_mut().end_fake(now_ns, id);
        if removed { Ok(()) } else { Err(StationRefusal::NoFake) }
    }

    fn check_place(&self, position: Position) -> Result<(), StationRefusal> {
        self.ground.cell_at(position).map(drop).ok_or(StationRefusal::NoPath(position))
    }

    /// Asks something of one robot, or of all that are heard; the number of the request.
    ///
    /// # Errors
    /// Why nobody is asked.
    pub fn ask(&mut self, now_ns: u64, kind: RequestKind, robot: Option<RobotId>) -> Result<u32, StationRefusal> {
        let group = self.payload.team().group();
        let heard = group.heard(now_ns).filter(|(it, _)| robot.is_none_or(|robot| robot == *it));
        let robots: BTreeMap<_, _> =
            heard.map(|(it, direct)| (it, (direct.version.incarnation, Asking::Waiting))).collect();
        if robots.is_empty() {
            return Err(robot.map_or(StationRefusal::Nobody, StationRefusal::NotHeard));
        }
        if self.asked.len() == REQUESTS_MAX {
            let over = self.asked.iter().position(Asked::is_over).ok_or(StationRefusal::Busy)?;
            self.asked.remove(over);
        }
        self.newest += 1;
        self.asked.push_back(Asked { number: self.newest, kind, at_ns: now_ns, tries: 0, robots });
        self.repeat(now_ns, self.asked.len() - 1);
        Ok(self.newest)
    }

    /// What was asked, oldest first.
    pub fn asked(&self) -> impl Iterator<Item = &Asked> {
        self.asked.iter()
    }

    /// What mobiles said, oldest first.
    pub fn said(&self) -> impl Iterator<Item = &Said> {
        self.said.iter()
    }

    /// What it knows of its team.
    pub fn team(&self) -> &Team {
        self.payload.team()
    }
}
