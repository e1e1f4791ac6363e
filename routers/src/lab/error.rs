//! Why a lab cannot be, or cannot do something.

use std::io;
use std::time::Duration;

/// The kernel notices within a second that a link works.
pub(super) const RUNS_WITHIN: Duration = Duration::from_secs(10);

/// Why a lab cannot be, or cannot do something.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// The system lets us make no namespaces.
    #[error(
        "network namespaces cannot be made here ({0}); run it as root, or let users make namespaces: \
         sysctl -w user.max_user_namespaces=10000 user.max_net_namespaces=10000 \
         kernel.apparmor_restrict_unprivileged_userns=0; \
         in a container, start it with --privileged"
    )]
    NotAllowed(io::Error),
    /// See [`become_able`](super::become_able).
    #[error("a user namespace must be entered before there is a second thread; call `become_able` first of all")]
    Threads,
    /// A namespace.
    #[error("{0}: {1}")]
    Namespace(&'static str, io::Error),
    /// A device, an address.
    #[error("lab: cannot {0}: {1}{hint}", hint = hint(.1))]
    Device(String, io::Error),
    /// No node of this name.
    #[error("the lab has no node `{0}`; its nodes are {1}")]
    NoNode(String, String),
    /// The kernel never said that it carries packets.
    #[error("lab: the link of node `{0}` does not work after {RUNS_WITHIN:?}")]
    NoCarrier(String),
    /// A program.
    #[error("cannot start {0}: {1}")]
    Start(String, io::Error),
}

/// What would help.
fn hint(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::Unsupported => "; the kernel needs its modules `bridge` and `veth`: modprobe bridge veth",
        _ if error.raw_os_error() == Some(nix::libc::EAFNOSUPPORT) => {
            "; this kernel does not have this kind of address"
        }
        _ => "",
    }
}
