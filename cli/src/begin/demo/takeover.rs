//! The demo's report on a router's death: when the router was back, and the next master.
//!
//! A thread observes the bridge and the nodes' tables. It sends nothing, so it adds no traffic.

use super::incarnations::{Death, Incarnations, RouterKind};
use super::masters::{MasterTerm, Masters, SealedCapture};
use crate::terminal::Failure;
use crate::terminal::table::time;
use rohrpost_config::Installation;
use rohrpost_mailbox::monotonic_ns;
use rohrpost_routers::lab::Capture;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// A death is detected within this time.
const LOOK: Duration = Duration::from_millis(5);
/// The same on a busy computer: the master at a death is the node that sent the time at most this long before.
const FOUND_NS: u64 = 500_000_000;
/// The capture is read every so many polls; frames wait in the kernel with their time stamps.
const READ_LOOKS: u32 = 10;

/// The observing thread.
pub(super) struct Watch {
    /// Requests to kill a router; when this end closes, the thread ends.
    kill: Sender<Victim>,
    thread: JoinHandle<TakeoverRecord>,
    installation: Arc<Installation>,
}

/// Which router to kill.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Victim {
    /// The router of the present master of time.
    Master,
    TcpRouter,
}

/// Its observations.
pub(super) struct TakeoverRecord {
    installation: Arc<Installation>,
    began_ns: u64,
    incarnations: Incarnations,
    masters: Masters,
    /// Processes that were killed on purpose.
    on_purpose: Vec<u32>,
    /// Requests to kill while there was no master.
    in_vain: u32,
}

impl Watch {
    /// For nodes that all run.
    pub(super) fn begin(installation: &Arc<Installation>, capture: Capture) -> Result<Self, Failure> {
        let (kill, words) = channel();
        let seen = TakeoverRecord {
            installation: installation.clone(),
            began_ns: monotonic_ns(),
            incarnations: Incarnations::of(installation)?,
            masters: Masters::heard_with(SealedCapture::of(installation)?),
            on_purpose: Vec::new(),
            in_vain: 0,
        };
        let thread = std::thread::Builder::new().name("watch".into()).spawn(move || seen.watch(capture, &words))?;
        Ok(Self { kill, thread, installation: installation.clone() })
    }

    pub(super) fn kill(&self, victim: Victim) {
        // It ends only when the channel closes.
        let _ = self.kill.send(victim);
    }

    pub(super) fn end(self) -> Result<TakeoverRecord, Failure> {
        drop(self.kill);
        let name = &self.installation.name;
        self.thread.join().map_err(|_| format!("the thread that watches {name} has panicked").into())
    }
}

impl TakeoverRecord {
    fn watch(mut self, mut capture: Capture, words: &Receiver<Victim>) -> Self {
        let mut looks = 0;
        loop {
            let word = words.recv_timeout(LOOK);
            self.incarnations.look();
            looks += 1;
            if looks % READ_LOOKS == 0 || word != Err(RecvTimeoutError::Timeout) {
                capture.drain(|crossing| self.masters.note(&crossing));
            }
            match word {
                Ok(victim) => self.kill(victim),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return self,
            }
        }
    }

    fn kill(&mut self, victim: Victim) {
        let killed = match victim {
            Victim::Master => {
                let master = self.masters.master_at(monotonic_ns()).map(|term| usize::from(term.node));
                master.and_then(|node| self.incarnations.kill(RouterKind::Lan, Some(node)))
            }
            Victim::TcpRouter => self.incarnations.kill(RouterKind::Tcp, None),
        };
        match killed {
            Some(pid) => self.on_purpose.push(pid),
            None => self.in_vain += 1,
        }
    }

    /// Nodes with more than one incarnation of the router.
    pub(super) fn died(&self) -> Vec<&str> {
        let name = |death: &Death| self.installation.nodes[death.node].name.as_str();
        let mut names: Vec<&str> = self.deaths(RouterKind::Lan).map(name).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Whether each dead router came back, and was killed if requested.
    pub(super) fn is_well(&self) -> bool {
        self.in_vain == 0
            && self.all_are_watched()
            && self.incarnations.deaths.iter().all(|death| death.again.is_some())
    }

    fn all_are_watched(&self) -> bool {
        self.incarnations.refused().next().is_none()
    }

    fn deaths(&self, kind: RouterKind) -> impl Iterator<Item = &Death> {
        self.incarnations.deaths.iter().filter(move |death| death.kind == kind)
    }

    /// Whether the TCP router had more than one incarnation.
    pub(super) fn tcp_router_died(&self) -> bool {
        self.deaths(RouterKind::Tcp).next().is_some()
    }

    /// The report in words; empty when no router died.
    pub(super) fn text(&self) -> String {
        let mut text: String = self.deaths(RouterKind::Lan).map(|death| self.event(death)).collect();
        for death in self.deaths(RouterKind::Tcp) {
            text += &format!("The TCP router {}.\n", self.death_text(death));
        }
        for (node, why) in self.incarnations.refused() {
            text += &format!(
                "A router of node {} is not watched, or was not killed: {why}.\n",
                self.installation.nodes[node].name
            );
        }
        if self.in_vain > 0 && self.all_are_watched() {
            text += "no router was killed, as there was none: no master, if [time] of the configuration is without \
                `source = \"master\"`, or no TCP router\n";
        }
        if self.deaths(RouterKind::Lan).next().is_some() {
            let master = self.masters.master_at(u64::MAX).map(|term| self.name(term));
            text += &format!("Master at the end: {}.\n", master.unwrap_or("none was heard"));
        }
        text
    }

    fn name(&self, term: &MasterTerm) -> &str {
        self.installation.nodes.get(usize::from(term.node)).map_or("?", |node| &node.name)
    }

    fn event(&self, death: &Death) -> String {
        let what = format!("The router of {} {}.\n", self.installation.nodes[death.node].name, self.death_text(death));
        what + &self.takeover(death).unwrap_or_else(|| "  It was not the master.\n".into())
    }

    /// When it died, and when it was back.
    fn death_text(&self, death: &Death) -> String {
        let after = |from_ns: u64, to_ns: u64| time(Duration::from_nanos(to_ns.saturating_sub(from_ns)));
        let why = if self.on_purpose.contains(&death.pid) { "killed on purpose" } else { "not by this command" };
        let again = match death.again {
            Some((pid, at_ns)) => format!("there again {} later (process {pid})", after(death.at_ns, at_ns)),
            None => "not there again".into(),
        };
        let at = after(self.began_ns, death.at_ns);
        format!("died {at} after the beginning (process {}, {why}); {again}", death.pid)
    }

    /// The succession of the master, if it was the master.
    fn takeover(&self, death: &Death) -> Option<String> {
        let is_its = |last: &&MasterTerm| death.at_ns < last.last_ns + FOUND_NS || self.on_purpose.contains(&death.pid);
        let last = self.masters.last_of(death.node, death.at_ns).filter(is_its)?;
        let after = |term: &MasterTerm| {
            let cycles = term.first_cycle.saturating_sub(last.last_cycle);
            let took = time(Duration::from_nanos(term.first_ns.saturating_sub(last.last_ns)));
            format!("{cycles} {} ({took}) after its last", if cycles == 1 { "cycle" } else { "cycles" })
        };
        let next = match self.masters.next_after(last.last_ns) {
            None => "No other took over.".into(),
            Some(term) if term.node == last.node => format!("It was master again {}.", after(term)),
            Some(term) => format!("{} was master from the sync on that came {}.", self.name(term), after(term)),
        };
        Some(format!("  It was the master. {next}\n"))
    }
}
