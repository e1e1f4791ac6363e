//! The configuration's security, and whether its files are here.

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
