//! What protects packages that leave this computer.

use super::finding::{Check, Finding};
use super::machine::{Machine, Needs};
use super::protection::{LanProtection, Protection, Tcp};

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
