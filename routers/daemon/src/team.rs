//! A node's router of the team, as a module.

use crate::router::faults::Encoded;
use crate::router::keys::{incarnation, read};
use crate::tcp::ends::{PERIOD, classes};
use rohrpost_config::{Installation, Team, TeamReach};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_modules::interfaces::{CarriedLoss, TeamLinks, TeamNode, TeamRouter, TeamRouterInterface};
use rohrpost_modules::runtime::Context;
use rohrpost_modules::{Module, ModuleError, NoSettings};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::security::{KeyRing, random};
use rohrpost_routers::shell::team::{TeamParts, TeamShell};
use rohrpost_routers::tcp::Class;
use rohrpost_routers::team::{TeamRefusal, TeamSettings, Teammate};
use std::sync::Arc;

/// A router of the team.
pub(crate) struct TeamRouterModule {
    shell: TeamShell,
    node: String,
    reach: String,
    is_sealed: bool,
}

impl TeamRouter for TeamRouterModule {}

impl Module for TeamRouterModule {
    type Settings = NoSettings;
    type Interfaces = TeamRouterInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let team = installation.team.as_ref().ok_or_else(|| ModuleError::new("the configuration has no [team]"))?;
        let node_name = installation.node_of(context.me()).unwrap_or_default().to_owned();
        let missing = || ModuleError::new(format!("[team]: `address` names none of node `{node_name}`"));
        let address = team.address_of(&node_name).ok_or_else(missing)?;
        let keys = team.keys.as_deref().map(read).transpose()?;
        if keys.is_none() {
            tracing::warn!("{}", Team::UNPROTECTED);
        }
        let is_sealed = keys.is_some();
        let settings = settings(installation, &node_name, keys)?;
        let others = installation.nodes.iter().filter(|other| other.name != node_name);
        let node = context.link().borrow().participant().node().clone();
        let shell = TeamShell::start(TeamParts {
            node: &node,
            name: context.me(),
            settings,
            team,
            address,
            hosts: installation.names_reached(&node_name),
            others: others.flat_map(|other| installation.names_reached(&other.name)).collect(),
            names: installation.names_of_others(),
            faults: Arc::new(Encoded::of(installation)),
            tcp: installation.tcp_client_of(&node_name),
        })?;
        let reach = match team.reach {
            TeamReach::Group(group) => format!("{group}:{}", team.port),
            TeamReach::Peers { .. } => format!("{address}:{}", team.port),
        };
        context.use_computer_clock();
        context.set_period(PERIOD);
        Ok(Self { shell, node: node_name, reach, is_sealed })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        // It cannot work without its thread; launch restarts it.
        assert!(self.shell.is_well(), "the thread of the router of the team has ended");
        let (links, counts, now_ns) = (self.shell.links(), self.shell.counts(), monotonic_ns());
        let refused =
            TeamRefusal::ALL.map(|why| CarriedLoss { cause: why.word().into(), packages: counts.refused(why) });
        context.publish_now(
            TeamRouterInterface::LINKS,
            &TeamLinks {
                name: self.node.clone(),
                reach: self.reach.clone(),
                sealed: self.is_sealed,
                why: links.why,
                nodes: links.teammates.iter().map(|mate| node(mate, now_ns)).collect(),
                datagrams_sent: counts.sent.get(),
                datagrams_came: counts.came.get(),
                copies: counts.copies.get(),
                refused: refused.into_iter().filter(|loss| loss.packages > 0).collect(),
                sent: classes(&Class::all(&counts.out)),
                received: classes(&Class::all(&counts.inn)),
            },
        )?;
        Ok(())
    }
}

fn settings(installation: &Installation, node: &str, keys: Option<KeyRing>) -> Result<TeamSettings, ModuleError> {
    let peers = installation.team.as_ref().filter(|team| matches!(team.reach, TeamReach::Peers { .. }));
    Ok(TeamSettings {
        system: installation.system.id,
        node: installation.node_index(node).unwrap_or_default(),
        common: installation.digest().common,
        incarnation: incarnation(true)?,
        seed: random()?,
        keys,
        reached: peers.map(|team| team.peers().iter().map(|peer| peer.system).collect()),
        admission: Admission::new(installation, node),
    })
}

fn node(mate: &Teammate, now_ns: u64) -> TeamNode {
    TeamNode {
        system: mate.system,
        node: mate.node,
        address: mate.address.to_string(),
        proven: mate.is_proven,
        hears_us: mate.hears_us,
        heard_ms: now_ns.saturating_sub(mate.heard_ns) / 1_000_000,
        sent: mate.sent,
        missed: mate.lost,
        incarnations: mate.incarnations,
        returns: mate.returns,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_modules::wire::append;
    use rohrpost_routers::team::MEMBERS_MAX;

    #[test]
    fn the_largest_report_fits_into_a_package() {
        let most = u64::MAX;
        let address = "[2001:db8:ffff:ffff:ffff:ffff:ffff:ffff]:65535";
        let node = TeamNode {
            system: u8::MAX,
            node: u8::MAX,
            address: address.into(),
            proven: true,
            hears_us: true,
            heard_ms: most,
            sent: most,
            missed: most,
            incarnations: most,
            returns: most,
        };
        let refused = TeamRefusal::ALL.map(|why| CarriedLoss { cause: why.word().into(), packages: most });
        let all = TeamLinks {
            name: "x".repeat(250),
            why: "x".repeat(1000),
            nodes: vec![node; MEMBERS_MAX],
            refused: refused.into(),
            ..TeamLinks::default()
        };
        let mut body = Vec::new();
        append(&mut body, &all).unwrap();
        assert!(body.len() < rohrpost_mailbox::BODY_BYTES_MAX / 2, "{}: with classes beside", body.len());
    }
}
