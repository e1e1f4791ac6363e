//! How scans come to a module.

use rohrpost_modules::interfaces::LaserInterface;
use rohrpost_modules::runtime::{Context, ContextError, Rate, Received, StreamSubscription, Subscription, Unreadable};
use rohrpost_modules::types::LaserScan;

/// Each scan of a scanner, wherever that is.
pub(super) enum Scans {
    /// From the stream of a module on this node.
    Stream(StreamSubscription<LaserScan>),
    /// From another node, in packages.
    Packages(Subscription<LaserScan>),
}

impl Scans {
    pub(super) fn subscribe(context: &mut Context, laser: &str) -> Result<Self, ContextError> {
        match context.subscribe_stream(LaserInterface::SCAN, laser) {
            Ok(stream) => Ok(Self::Stream(stream)),
            Err(ContextError::FarStream { .. }) => {
                context.subscribe(LaserInterface::SCAN.data(), laser, Rate::Each).map(Self::Packages)
            }
            Err(error) => Err(error),
        }
    }

    /// The scan, if this data is one.
    pub(super) fn read(&self, data: &Received<'_>) -> Result<Option<LaserScan>, Unreadable> {
        match self {
            Self::Stream(stream) => data.read(stream),
            Self::Packages(packages) => data.read(packages),
        }
    }
}
