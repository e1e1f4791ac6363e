//! The mistakes, each with the promise that it breaks. A proof that cannot fail proves nothing.

mod lease;
mod wormhole;

use rohrpost_planted::Catalog;

pub(crate) const MISTAKES: &Catalog = &[wormhole::MISTAKES, lease::MISTAKES];
