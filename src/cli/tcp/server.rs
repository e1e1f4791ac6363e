//! The TCP router, as a module.

use super::{NoSettings, PERIOD, classes, levels, short};
use crate::cli::router::faults::Encoded;
use rohrpost::config::Tcp as Configured;
use rohrpost::interfaces::{BeyondClient, BeyondClients, Tcp, TcpInterface};
use rohrpost::mailbox::{monotonic_ns, realtime_ns};
use rohrpost::{Context, Module, ModuleError};
use rohrpost_routers::session::server::ServerSettings;
use rohrpost_routers::tcp::{Member, ServerParts, ServerSeal, ServerShell};
use std::net::SocketAddr;
use std::sync::Arc;

pub(super) struct ServerModule {
    shell: ServerShell,
    address: SocketAddr,
    began_ns: u64,
}

impl Tcp for ServerModule {}

impl Module for ServerModule {
    type Settings = NoSettings;
    type Interfaces = TcpInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let tcp = installation.tcp.as_ref().ok_or_else(|| ModuleError::new("the configuration has no [tcp]"))?;
        let seal = match &tcp.certificates {
            Some(folder) => Some(ServerSeal::load(&installation.resolve(folder))?),
            None => {
                tracing::warn!("{}", Configured::UNPROTECTED);
                None
            }
        };
        let digest = installation.digest();
        let settings = ServerSettings {
            name: short(&format!("the TCP router of {}", installation.system.name)),
            common: digest.common,
            system: Some((installation.system.id, digest.system)),
            life: realtime_ns().max(1),
            clients_max: tcp.clients,
            greetings_max: tcp.clients.max(GREETINGS_MIN),
            quota_bytes: tcp.quota_bytes,
            levels: levels(tcp),
        };
        let address = tcp.address;
        let faults = Arc::new(Encoded::of(installation));
        let node = context.link().borrow().participant().node().clone();
        let shell = ServerShell::start(ServerParts { address, settings, faults, seal, node: &node })?;
        context.set_period(PERIOD);
        Ok(Self { shell, address, began_ns: monotonic_ns() })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        // Without its thread it is of no use; started again, it is.
        assert!(self.shell.is_well(), "the thread of the TCP router has ended");
        let seen = self.shell.members();
        context.publish_now(
            TcpInterface::CLIENTS,
            &BeyondClients {
                address: self.address.to_string(),
                uptime_ms: monotonic_ns().saturating_sub(self.began_ns) / 1_000_000,
                clients: seen.members.into_iter().map(client).collect(),
                left: seen.left,
                refused: seen.refused,
                refusal: seen.refusal,
                classes: classes(&seen.classes),
            },
        )?;
        Ok(())
    }
}

/// Connections that have not said hello yet, at least.
const GREETINGS_MIN: u16 = 64;

fn client(member: Member) -> BeyondClient {
    BeyondClient {
        name: member.name,
        address: member.peer,
        system: member.system,
        takes_part: member.is_member,
        ranges: member.ranges,
        age_ms: member.age_ns / 1_000_000,
        heard_ms: member.heard_ns / 1_000_000,
        bytes: member.bytes,
    }
}
