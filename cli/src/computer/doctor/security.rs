//! What protects packages that leave this computer: what the configuration says, and whether its files are here.

use super::finding::{Check, Finding};
use super::machine::{Machine, Needs};
use crate::nodes::keys::certificates;
use rohrpost_config::{Installation, Keys};
use rohrpost_network::Security;
use std::path::PathBuf;

/// The configuration's security, and the files that exist here.
#[derive(Clone, Debug, Default)]
pub(super) struct Protection {
    /// Between the nodes of the LAN; none without a LAN.
    pub(super) lan: Option<LanProtection>,
    /// To the TCP router; none if the file has none.
    pub(super) tcp: Option<Tcp>,
}

#[derive(Clone, Debug)]
pub(super) enum LanProtection {
    Open,
    /// Sealed with the keys of a file, by their numbers; or why these cannot be used.
    Keys {
        file: PathBuf,
        ids: Result<Vec<u8>, String>,
    },
}

/// The protection of sessions with the TCP router.
#[derive(Clone, Debug)]
pub(super) enum Tcp {
    Open,
    /// Both ends show certificates; the files that this node lacks.
    Tls {
        folder: PathBuf,
        lacking: Vec<String>,
    },
}

impl Protection {
    pub(super) fn of(installation: &Installation, node: &str) -> Self {
        let lan = installation.network.map(|network| match (network.security, &installation.keys) {
            (Security::Keys, Some(folder)) => {
                let file = Keys::file(folder);
                let ids = Keys::load(&file).map_err(|error| error.to_string());
                let ids = ids.map(|keys| [Some(keys.newest), keys.older].into_iter().flatten().map(|key| key.id.get()));
                LanProtection::Keys { ids: ids.map(Iterator::collect), file }
            }
            _ => LanProtection::Open,
        });
        let tcp = installation.tcp.as_ref().map(|tcp| match &tcp.certificates {
            None => Tcp::Open,
            Some(folder) => {
                Tcp::Tls { folder: installation.resolve(folder), lacking: certificates::lacking(installation, node) }
            }
        });
        Self { lan, tcp }
    }
}

pub(super) fn findings(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let from = needs.from.as_ref().map(|path| path.display().to_string()).unwrap_or_default();
    let Protection { lan: of_lan, tcp: of_tcp } = &machine.asked.protection;
    of_lan.iter().map(|of| lan(of, &from)).chain(of_tcp.iter().map(|of| tcp(of, &from))).collect()
}

fn lan(protection: &LanProtection, from: &str) -> Finding {
    let check =
        Check("network security", "packages between nodes are sealed, or anyone on the network reads and sends");
    match protection {
        LanProtection::Open => check.warn(
            format!("none, as {from} says"),
            format!(
                "use a separate network for the robot, without access from others; or write `security = \"keys\"` \
                 into [network] of {from}, and run `rohrpost keys new {from}`"
            ),
        ),
        LanProtection::Keys { file, ids: Ok(ids) } => {
            let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
            let word = if ids.len() == 1 { "key" } else { "keys" };
            check.ok(format!("{word} {} of {}, as {from} says", ids.join(" and "), file.display()))
        }
        LanProtection::Keys { ids: Err(error), .. } => check.bad(
            format!("{from} requires keys, and there are none: {error}"),
            "copy the keys from the first computer of the installation; only if none has any, `rohrpost keys new` \
            makes them",
        ),
    }
}

fn tcp(protection: &Tcp, from: &str) -> Finding {
    let check =
        Check("TCP security", "packages to and from the TCP router are sealed, or anyone on the way reads and sends");
    match protection {
        Tcp::Open => check.warn(
            format!("none, as {from} says"),
            format!(
                "use a network without access from others; or write `security = \"tls\"` and `certificates \
                 = \"certificates\"` into [tcp] of {from}, and run `rohrpost keys new {from}`"
            ),
        ),
        Tcp::Tls { folder, lacking } if lacking.is_empty() => {
            check.ok(format!("TLS 1.3 with certificates in {}, as {from} says", folder.display()))
        }
        Tcp::Tls { lacking, .. } => check.bad(
            format!("{from} requires TLS, and this node lacks files: {}", lacking.join("; ")),
            "copy `ca.pem` and the two files of this node from where the certificates were made",
        ),
    }
}
