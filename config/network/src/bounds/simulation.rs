//! Simulation of one node and its slots, written independently of the analysis, to test it.

use super::response::{Supply, Window};

/// A system to simulate.
#[derive(Clone, Debug)]
pub(super) struct System {
    pub(super) supply: Supply,
    pub(super) flows: Vec<Sent>,
    /// An empty datagram, the shortest and the longest one, ns.
    pub(super) head_ns: u64,
    pub(super) least_ns: u64,
    pub(super) most_ns: u64,
}

/// A stream of packages.
#[derive(Clone, Debug)]
pub(super) struct Sent {
    pub(super) period_ns: u64,
    /// 0 goes first.
    pub(super) level: u8,
    pub(super) peer: u8,
    /// Size, as transmission time.
    pub(super) size_ns: u64,
}

/// Parameters of one run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Play {
    /// The first package of each stream comes just after the slot at this offset in the first round took its packages,
    /// ns.
    pub(super) from_ns: u64,
    /// Shifts the streams against each other and makes the open choices; 0: all come at once, and all choices are the
    /// worst.
    pub(super) seed: u64,
    /// Packages that come during a slot may leave in it.
    pub(super) looks_again: bool,
    /// Behind the packages parts of replicas leave, of the longest datagrams; there are always some.
    pub(super) replicas: bool,
    /// Rounds of the table.
    pub(super) rounds: u64,
}

impl Play {
    /// The local clock of the computer at a slot time.
    fn local_ns(&self, supply: &Supply, system_ns: u64) -> u64 {
        let by_ns = (u128::from(system_ns) * u128::from(supply.bends_ns_s) / 1_000_000_000) as u64;
        match self.seed % 3 {
            0 => system_ns + by_ns,
            1 => system_ns - by_ns,
            _ => system_ns,
        }
    }
}

/// What happened in a run.
pub(super) struct Played {
    /// The longest time from publishing to the end of the last datagram, by stream.
    pub(super) worst: Vec<u64>,
    /// Parts of replicas that left.
    pub(super) parts: u64,
}

struct Waiting {
    flow: usize,
    published_ns: u64,
    /// Rest to send, ns.
    left_ns: u64,
    parts: bool,
}

impl System {
    /// Size of a fragment of a package too large for a datagram, ns.
    fn part_ns(&self) -> u64 {
        self.most_ns - self.head_ns
    }

    pub(super) fn is_whole(&self, flow: &Sent) -> bool {
        flow.size_ns <= self.part_ns()
    }

    /// A datagram of this size, ns.
    pub(super) fn datagram_ns(&self, size_ns: u64) -> u64 {
        (self.head_ns + size_ns).max(self.least_ns)
    }

    /// Datagrams of one package.
    pub(super) fn datagrams_ns(&self, flow: &Sent) -> Vec<u64> {
        let mut left_ns = flow.size_ns;
        let mut datagrams = Vec::new();
        while left_ns > 0 {
            let part_ns = left_ns.min(self.part_ns());
            datagrams.push(self.datagram_ns(part_ns));
            left_ns -= part_ns;
        }
        datagrams
    }

    /// Runs.
    pub(super) fn play(&self, play: Play) -> Played {
        let mut draw = Draw(play.seed);
        let mut published = self.published(play, &mut draw);
        published.reverse();
        let (mut waiting, mut worst, mut parts) = (Vec::<Waiting>::new(), vec![0; self.flows.len()], 0);
        // The first round has begun when the first packages come.
        for round in 0..play.rounds {
            for window in &self.supply.windows {
                let begin_ns = round * self.supply.repeats_ns + window.begin_ns;
                let local_ns = |system_ns| play.local_ns(&self.supply, system_ns);
                let sends_ns = local_ns(begin_ns + window.sends_ns) - local_ns(begin_ns);
                let here = Window { begin_ns: local_ns(begin_ns), sends_ns, ..*window };
                parts += self.slot(play, &here, &mut draw, &mut published, &mut waiting, &mut worst);
            }
        }
        let end_ns = play.local_ns(&self.supply, play.rounds * self.supply.repeats_ns);
        for late in waiting {
            worst[late.flow] = worst[late.flow].max(end_ns - late.published_ns);
        }
        Played { worst, parts }
    }

    /// All packages by time; of those at one time the last stream's first, so that the first stream has all others
    /// ahead of it.
    fn published(&self, play: Play, draw: &mut Draw) -> Vec<(u64, usize)> {
        let end_ns = play.local_ns(&self.supply, play.rounds.saturating_sub(1) * self.supply.repeats_ns);
        let from_ns = play.local_ns(&self.supply, self.supply.repeats_ns + play.from_ns);
        let from_ns = from_ns.saturating_sub(self.supply.taken_before_ns) + 1;
        let mut all = Vec::new();
        for (index, flow) in self.flows.iter().enumerate() {
            let mut at_ns = from_ns + draw.below(flow.period_ns);
            while at_ns < end_ns {
                all.push((at_ns, index));
                at_ns += flow.period_ns + if draw.below(4) == 3 { draw.below(flow.period_ns / 4) } else { 0 };
            }
        }
        all.sort_by_key(|(at_ns, index)| (*at_ns, usize::MAX - index));
        all
    }

    /// How many parts of replicas leave in it.
    fn slot(
        &self,
        play: Play,
        &Window { begin_ns, sends_ns, .. }: &Window,
        draw: &mut Draw,
        published: &mut Vec<(u64, usize)>,
        waiting: &mut Vec<Waiting>,
        worst: &mut [u64],
    ) -> u64 {
        let mut replicated = 0;
        let mut now_ns = begin_ns + draw.most(self.supply.late_ns) + draw.most(self.supply.said_ns);
        let guard_ns = begin_ns + sends_ns;
        let mut takes_until_ns = begin_ns.saturating_sub(draw.most(self.supply.taken_before_ns));
        loop {
            while published.last().is_some_and(|(at_ns, _)| *at_ns <= takes_until_ns) {
                let Some((published_ns, flow)) = published.pop() else { break };
                let parts = !self.is_whole(&self.flows[flow]);
                waiting.push(Waiting { flow, published_ns, left_ns: self.flows[flow].size_ns, parts });
                waiting.sort_by_key(|package| self.flows[package.flow].level);
            }
            let fits = |head: &&Waiting| now_ns + self.datagram_ns(head.left_ns.min(self.part_ns())) <= guard_ns;
            let Some(head) = waiting.first().filter(fits) else {
                if !play.replicas || now_ns + self.most_ns > guard_ns {
                    break;
                }
                now_ns += self.most_ns;
                replicated += 1;
                if play.looks_again {
                    takes_until_ns = takes_until_ns.max(now_ns);
                }
                continue;
            };
            let peer = self.flows[head.flow].peer;
            let mut size_ns = head.left_ns.min(self.part_ns());
            let mut inside = vec![0];
            if !head.parts {
                size_ns = self.company(peer, size_ns, guard_ns - now_ns, waiting, &mut inside);
            }
            let is_alone = !play.replicas && !waiting[0].parts;
            let is_filled = is_alone && inside.len() == waiting.len() && draw.below(2) == 0;
            let filled_ns = if is_filled { self.part_ns() } else { size_ns };
            // Packages of a lower level, if nothing else is to leave.
            let takes_ns = self.datagram_ns(filled_ns).min(guard_ns - now_ns).max(self.datagram_ns(size_ns));
            now_ns += takes_ns;
            for at in inside.into_iter().rev() {
                let package = &mut waiting[at];
                package.left_ns = package.left_ns.saturating_sub(self.part_ns());
                if package.left_ns == 0 {
                    let package = waiting.remove(at);
                    worst[package.flow] = worst[package.flow].max(now_ns - package.published_ns);
                }
            }
            if play.looks_again {
                takes_until_ns = takes_until_ns.max(now_ns);
            }
        }
        replicated
    }

    /// Packages in the same datagram as the first that waits: to the same peer, and not less important than those that
    /// wait for others.
    fn company(&self, peer: u8, size_ns: u64, room_ns: u64, waiting: &[Waiting], inside: &mut Vec<usize>) -> u64 {
        let level = |package: &Waiting| self.flows[package.flow].level;
        let is_its = |package: &Waiting| self.flows[package.flow].peer == peer;
        let others = waiting.iter().filter(|package| !is_its(package)).map(level).min();
        let mut all_ns = size_ns;
        for (at, package) in waiting.iter().enumerate().skip(1).filter(|(_, package)| is_its(package)) {
            let longer_ns = all_ns + package.left_ns;
            let fits = self.datagram_ns(longer_ns) <= room_ns.min(self.most_ns);
            if package.parts || !fits || others.is_some_and(|others| level(package) > others) {
                break;
            }
            all_ns = longer_ns;
            inside.push(at);
        }
        all_ns
    }
}

/// Random numbers from a seed.
struct Draw(u64);

impl Draw {
    /// Below the limit; 0 in the worst run.
    fn below(&mut self, limit: u64) -> u64 {
        if self.0 == 0 {
            return 0;
        }
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit.max(1)
    }

    /// At most this, and exactly this in one of two cases and in the worst run.
    fn most(&mut self, most: u64) -> u64 {
        if self.0 == 0 || self.below(2) == 0 { most } else { self.below(most + 1) }
    }
}
