//! The routers with mistakes planted in them: the simulation and the routers' own tests must notice each. Not
//! published, and compiled for tests only.
//!
//! The product has no trace of them. The build script copies its sources and changes them as [`catalog`] says; each
//! change asks at run time whether its mistake is made, so one copy has all of them.

#![allow(warnings, clippy::all, clippy::pedantic, clippy::nursery, reason = "a copy with mistakes")]
#![forbid(unsafe_code)]

/// Whether a mistake is made now.
macro_rules! broken {
    ($mistake:ident) => {
        crate::mistakes::is(crate::mistakes::Mistake::$mistake)
    };
}

pub mod catalog;
pub mod mistakes;
#[cfg(test)]
mod noticed;

include!(concat!(env!("OUT_DIR"), "/copy/lib.rs"));
