//! Values as the bytes that travel in packages: postcard, as `docs/src/wire.md` describes it.
//!
//! Proxies and [`Context`](crate::runtime::Context) encode and decode by themselves. This is for tools that call
//! functions by number and read values themselves.
//!
//! ```
//! # use rohrpost_modules as rohrpost;
//! use rohrpost::wire::{append, from_bytes};
//!
//! let mut bytes = Vec::new();
//! append(&mut bytes, &(300_u16, "east"))?;
//! assert_eq!(from_bytes::<(u16, &str)>(&bytes)?, (300, "east"));
//! assert!(from_bytes::<u16>(&[0x80]).is_err(), "the number is cut off");
//! # Ok::<(), rohrpost::wire::Error>(())
//! ```

pub use crate::call::append;
pub use postcard::{Error, from_bytes};
