//! What robots send, and where it comes.

use super::{Happening, World};
use rohrpost_modules::types::Pose;
use rohrpost_team::RobotId;
use rohrpost_testbed::sim::radio::Place;
use std::rc::Rc;

/// Robots that are split off are on the air so far away, mm.
const FAR_MM: i32 = 1_000_000_000;

impl World {
    /// From now on these robots hear each other alone, and so do the others.
    pub fn split(&mut self, far: impl IntoIterator<Item = RobotId>) {
        self.far = far.into_iter().collect();
        self.alive().collect::<Vec<_>>().into_iter().for_each(|id| self.put_on_air(id));
    }

    pub(super) fn put_on_air(&mut self, id: RobotId) {
        let Some(Pose { x_m, y_m, .. }) = self.arena.moment(id).map(|moment| moment.pose) else { return };
        let far_mm = if self.far.contains(&id) { FAR_MM } else { 0 };
        self.radio.put(id, Place { x_mm: (x_m * 1000.0) as i32 + far_mm, y_mm: (y_m * 1000.0) as i32 });
    }

    pub(super) fn poll_router(&mut self, id: RobotId) {
        let now_ns = self.now_ns;
        loop {
            let robot = self.robot(id);
            if robot.is_dead {
                return;
            }
            let clock_ns = robot.clock_ns(now_ns);
            match robot.router.poll(clock_ns) {
                Ok(datagram) => self.send(id, &datagram.into()),
                Err(next_ns) => {
                    let next_ns = robot.clock.when(next_ns, now_ns);
                    if robot.router_due_ns <= now_ns || next_ns < robot.router_due_ns {
                        robot.router_due_ns = next_ns;
                        self.events.push(next_ns, Happening::Router(id));
                    }
                    return;
                }
            }
        }
    }

    pub(super) fn send(&mut self, from: RobotId, bytes: &Rc<[u8]>) {
        for (to, at_ns) in self.radio.send(self.now_ns, from, bytes.len(), &mut self.chance) {
            self.events.push(at_ns, Happening::Arrive(to, bytes.clone()));
        }
    }

    pub(super) fn arrive(&mut self, id: RobotId, bytes: &[u8]) {
        let now_ns = self.now_ns;
        let robot = self.robot(id);
        if robot.is_dead {
            return;
        }
        let clock_ns = robot.clock_ns(now_ns);
        let messages = robot.router.handle(clock_ns, bytes);
        for message in &messages {
            if let Some(payload) = &mut robot.payload {
                payload.hear(clock_ns, message).unwrap_or_else(|no| panic!("teammates understand each other: {no}"));
            }
        }
        if !messages.is_empty() {
            self.serve(id);
        }
        self.poll_router(id);
    }
}
