//! Asks a module of another node what it offers, part by part, and waits for nothing.

use crate::common::{DESCRIBE, DescriptionPart, HASH};
use crate::runtime::Context;
use crate::wire::{append, from_bytes};
use rohrpost_mailbox::Name;
use rohrpost_schema::Description;
use std::time::Duration;

/// Each part comes within this time, or all is asked for anew.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest description that is asked for, bytes.
const BYTES_MAX: u32 = 1 << 20;

/// A description that is being asked for.
///
/// ```
/// use rohrpost_mailbox::Name;
/// use rohrpost_modules::{description::DescriptionRequest, runtime::Context};
///
/// fn class_of(request: &mut DescriptionRequest, context: &Context, module: Name) -> Option<String> {
///     Some(request.poll(context, module)?.class) // none: not yet
/// }
/// ```
#[derive(Default)]
pub struct DescriptionRequest {
    bytes: Vec<u8>,
    /// The call that is under way.
    call: Option<u32>,
}

impl DescriptionRequest {
    /// Whether an answer is awaited. After a failure none is, until [`DescriptionRequest::poll`] asks anew.
    pub fn is_under_way(&self) -> bool {
        self.call.is_some()
    }

    /// The description, when it is there. Asks for what is missing; after a failure, for all of it.
    pub fn poll(&mut self, context: &Context, module: Name) -> Option<Description> {
        let mut link = context.link().borrow_mut();
        link.collect();
        loop {
            let Some(call) = self.call else {
                let from = self.bytes.len() as u32;
                let write = |body: &mut Vec<u8>| append(body, &(from,));
                self.call = link.begin(module, DESCRIBE, HASH, PATIENCE, write).ok();
                return None;
            };
            let answer = link.poll_for(call, |bytes| from_bytes::<DescriptionPart>(bytes))?;
            self.call = None;
            let Some(part) = answer.ok().filter(|part| part.total <= BYTES_MAX && !part.bytes.is_empty()) else {
                self.bytes.clear();
                return None;
            };
            self.bytes.extend_from_slice(&part.bytes);
            if self.bytes.len() >= part.total as usize {
                return Description::from_bytes(&std::mem::take(&mut self.bytes)).ok();
            }
        }
    }
}
