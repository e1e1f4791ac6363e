//! The part of an installation beyond the LAN: clients of the TCP router, and the names that are reached through it.

use crate::classes::{TCP, TEAM_ROUTER};
use crate::installation::Installation;
use crate::module::Module;
use crate::tcp::{TCP_SERVER, Tcp};
use crate::team::Team;
use rohrpost_mailbox::{ALL_SYSTEMS, Name, local};

impl Installation {
    /// Security notes on LAN, TCP router and team, as far as there are any: `check` and every start print them.
    pub fn security_texts(&self) -> Vec<String> {
        let beyond = self.tcp.as_ref().map(Tcp::security_text).into_iter();
        let team = self.team.as_ref().map(Team::security_text);
        self.security_text().into_iter().chain(beyond).chain(team).collect()
    }

    /// Whether a section of the file leads to other systems.
    pub fn reaches_others(&self) -> bool {
        self.tcp.is_some() || self.team.is_some()
    }

    /// The router of `[team]` on a node; none without that section, or where it names no address of the node.
    pub fn team_router_of(&self, node: &str) -> Option<Name> {
        let class = self.classes.id(TEAM_ROUTER)?;
        self.team.as_ref()?.address_of(node)?;
        self.node_index(node).map(|index| Name::new(self.system.id, class.0, index, local::COMMANDS))
    }

    /// The names of all other systems, and those in all systems at once: with `[team]` packages for these go to the
    /// team's router.
    pub fn names_of_others(&self) -> Vec<(Name, Name)> {
        let own = self.system.id;
        let below = (own > 1).then(|| (Name::new(1, 1, 0, 0), Name::new(own - 1, u8::MAX, u8::MAX, u8::MAX)));
        let above = (Name::new(own + 1, 0, 0, 0), Name::new(ALL_SYSTEMS, u8::MAX, u8::MAX, u8::MAX));
        below.into_iter().chain([above]).collect()
    }

    /// The client of the TCP router on a node; none without `[tcp]`.
    pub fn tcp_client_of(&self, node: &str) -> Option<Name> {
        let class = self.classes.id(TCP).filter(|_| self.tcp.is_some())?;
        self.node_index(node).map(|index| Name::new(self.system.id, class.0, index, local::COMMANDS))
    }

    /// The TCP router, if it runs on a node of this system.
    pub fn tcp_router(&self) -> Option<Name> {
        let class = self.classes.id(TCP).filter(|_| self.tcp.as_ref().is_some_and(|tcp| tcp.server.is_some()))?;
        Some(Name::new(self.system.id, class.0, TCP_SERVER, local::COMMANDS))
    }

    /// The TCP router, if another system runs it: its name in all systems, since no configuration states the system.
    pub fn tcp_router_elsewhere(&self) -> Option<Name> {
        let class = self.classes.id(TCP).filter(|_| self.tcp.as_ref().is_some_and(|tcp| tcp.server.is_none()))?;
        Some(Name::new(ALL_SYSTEMS, class.0, TCP_SERVER, local::COMMANDS))
    }

    /// The names that a node hosts, each range with all mailboxes in it: its modules, their aliases, and its tools.
    /// Sorted; none overlaps another.
    pub fn names_on(&self, node: &str) -> Vec<(Name, Name)> {
        let tool = |instance: u8| Name::new(self.system.id, self.classes.tool().0, instance, 0);
        let tools = self.node(node).map(|node| (tool(*node.tools.start()), tool(*node.tools.end())));
        let modules = self.modules_on(node).flat_map(Module::names).map(|name| (name, name));
        let whole = |(first, last): (Name, Name)| (first.with_local(0), last.with_local(u8::MAX));
        let mut ranges: Vec<_> = modules.chain(tools).map(whole).collect();
        ranges.sort_unstable();
        ranges.dedup();
        ranges
    }

    /// The names of a node that are registered at the TCP router: all that it [reaches](Self::names_reached), except
    /// those that [move](Self::moving_names): the TCP router itself knows which node has these.
    pub fn names_registered(&self, node: &str) -> Vec<(Name, Name)> {
        let moving = self.moving_names();
        self.names_reached(node).into_iter().filter(|(first, _)| !moving.contains(&first.module())).collect()
    }

    /// The names of a node that are reached from beyond the LAN: all that it hosts, except the mailboxes by which its
    /// routers carry packages. The mailboxes that a router has in common with all modules are reached: others may query
    /// it, and its lines of output arrive.
    pub fn names_reached(&self, node: &str) -> Vec<(Name, Name)> {
        let carries = |first: Name| {
            let module = self.modules_on(node).find(|module| module.names().any(|name| name == first));
            module.is_some_and(|module| !module.is_in_file())
        };
        let common = |(first, last): (Name, Name)| match carries(first) {
            true => (first, last.with_local(local::DATA)),
            false => (first, last),
        };
        self.names_on(node).into_iter().map(common).collect()
    }

    /// The names with routes to the TCP router if neither this node nor its LAN has them: all that the node does not
    /// host itself.
    pub fn names_beyond(&self, node: &str) -> Vec<(Name, Name)> {
        let (mut from, mut beyond) = (Name::new(1, 1, 0, 0).raw(), Vec::new());
        for (first, last) in self.names_on(node) {
            if from < first.raw() {
                beyond.push((Name::from_raw(from), Name::from_raw(first.raw() - 1)));
            }
            from = last.raw().saturating_add(1);
        }
        beyond.push((Name::from_raw(from), Name::from_raw(u32::MAX)));
        beyond
    }
}
