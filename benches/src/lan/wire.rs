//! The network between the two ends of a case.

use crate::harness::{End, Failure};
use std::net::{IpAddr, Ipv4Addr};

/// Where each end has its address.
pub struct Wire {
    addresses: [IpAddr; 2],
}

impl Wire {
    /// Makes it.
    ///
    /// # Errors
    /// When it cannot be made here.
    pub fn new() -> Result<Self, Failure> {
        Ok(Self { addresses: [1, 2].map(|host| Ipv4Addr::new(127, 0, 0, host).into()) })
    }

    /// The address of an end.
    pub fn address(&self, end: End) -> IpAddr {
        self.addresses[usize::from(end == End::Pong)]
    }

    /// The calling process goes to this end; what it opens from now on is there.
    ///
    /// # Errors
    /// When it may not.
    pub fn enter(&self, _end: End) -> Result<(), Failure> {
        Ok(())
    }
}
