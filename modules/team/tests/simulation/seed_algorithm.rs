//! Algorithm 2 of seed 000 as it is printed, with its typing mistakes corrected: the variant that does not converge.
//! The model in `modules/team/proof` runs it, too.

use std::collections::{BTreeMap, BTreeSet};

/// What robots send: to all that hear them.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) enum Message {
    Hello { id: u8, leader: u8, group: u8 },
    Synchro { leader1: u8, leader2: u8, objects: BTreeSet<u8> },
}

/// One robot.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Seed {
    pub(crate) id: u8,
    pub(crate) leader: u8,
    pub(crate) group: u8,
    /// Other robots, and the beat of their last hello.
    pub(crate) robots: BTreeMap<u8, u64>,
    pub(crate) objects: BTreeSet<u8>,
}

impl Seed {
    pub(crate) fn new(id: u8, leader: u8, group: u8) -> Self {
        Self { id, leader, group, robots: BTreeMap::new(), objects: BTreeSet::new() }
    }

    pub(crate) fn pair(&self) -> (u8, u8) {
        (self.leader, self.group)
    }

    pub(crate) fn hello(&self) -> Message {
        Message::Hello { id: self.id, leader: self.leader, group: self.group }
    }

    fn synchro(&self, leader1: u8, leader2: u8) -> Message {
        Message::Synchro { leader1, leader2, objects: self.objects.clone() }
    }

    /// Lines 1 to 20.
    pub(crate) fn hear(&mut self, beat: u64, message: &Message) -> Option<Message> {
        match message {
            Message::Hello { id, leader, group } => {
                self.robots.insert(*id, beat);
                if (*leader, *group) == self.pair() {
                    None
                } else if id == leader && self.id == self.leader && *id < self.id {
                    Some(self.synchro(self.leader, *leader))
                } else if *id == self.leader {
                    let synchro = self.synchro(self.id, *leader);
                    self.leader = self.id;
                    Some(synchro)
                } else {
                    None
                }
            }
            Message::Synchro { leader1, leader2, objects } if self.leader == *leader2 => {
                self.leader = self.leader.min(*leader1);
                let answer = (self.id == self.leader).then(|| self.synchro(self.leader, *leader1));
                self.objects.extend(objects);
                self.group = (*leader1).max(*leader2);
                answer
            }
            Message::Synchro { .. } => None,
        }
    }

    /// Lines 22 to 30 and 39 to 46.
    pub(crate) fn beat(&mut self, beat: u64, max_age_beats: u64) {
        let gone: Vec<u8> =
            self.robots.iter().filter(|(_, heard)| beat > **heard + max_age_beats).map(|it| *it.0).collect();
        self.robots.retain(|id, _| !gone.contains(id));
        if gone.iter().any(|id| *id == self.leader || *id == self.group) {
            self.leader = self.robots.keys().copied().fold(self.id, u8::min);
            self.group = self.robots.keys().copied().fold(self.id, u8::max);
        }
    }
}
