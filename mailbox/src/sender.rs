//! The sending side of a mailbox: copy a package in, or write it in place.

use crate::figures::counters::Loss;
use crate::figures::traffic::Writer;
use crate::label::Label;
use crate::memory::owned::BadSegment;
use crate::memory::segment::Segment;
use crate::name::{Name, Priority};
use crate::node::participant::Participant;
use crate::node::routes;
use crate::place::Place;
use crate::send_error::SendError;
use crate::slots::full::NoSlot;
use crate::slots::latest::Posts;
use crate::slots::protocol::{Claim, Published};
use crate::step::step;
use crate::wake::doorbell;
use std::sync::Arc;

/// A mailbox that is replaced over and over while one package is sent: give up after so many.
const REOPEN_MAX: usize = 3;

/// Why there is no slot in the mailbox as it is.
enum NoClaim {
    TooLarge,
    NoSlot(NoSlot),
}

/// Why a filled claim was not published in its mailbox.
enum NotHere {
    /// The mailbox was given up: the package is sent anew.
    Retired(Claim),
    /// This process looked dead to the receiver.
    Reclaimed,
}

/// Where a sender may lead.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reach {
    /// To a mailbox of this node only.
    Here,
    /// Also to the router's, for mailboxes of other nodes.
    Routes,
}

/// One participant's way into one mailbox; if that is on another node, into the mailbox of this node's router.
pub struct Sender {
    participant: Arc<Participant>,
    /// Mailbox that the packages are for.
    to: Name,
    /// Mailbox that was opened: also when it is looked for again, whatever name the packages are for by then.
    opened: Name,
    /// Its memory, or that of the router's mailbox.
    segment: Segment,
    /// The registry's epoch in which the mailbox was found, or found to be elsewhere.
    epoch: u32,
    reach: Reach,
    place: Place,
    /// Counts what it sends.
    flows: Writer,
    /// What a newer package may replace; empty unless the mailbox is `latest`.
    posts: Posts,
}

impl Participant {
    /// Opens a mailbox for sending: one of this node; else, if the node's routes lead to it ([`Node::set_routes`]), the
    /// mailbox of the router that takes packages there, which then keep this name as their receiver. One map;
    /// afterwards sending needs no system call unless the receiver sleeps, no heap and no lock.
    ///
    /// [`Node::set_routes`]: crate::Node::set_routes
    ///
    /// # Errors
    /// [`SendError::NoMailbox`], [`SendError::NoRouter`], [`SendError::InUse`] when all its claims are spoken for, or
    /// [`SendError::Bad`].
    pub fn sender(self: &Arc<Self>, name: Name) -> Result<Sender, SendError> {
        self.sender_within(name, Reach::Routes)
    }

    /// Opens a mailbox of this node for sending, whatever routes there are: for a router that brings packages from
    /// other nodes, which must not go back there.
    ///
    /// # Errors
    /// As for [`Participant::sender`], but for [`SendError::NoRouter`].
    pub fn sender_here(self: &Arc<Self>, name: Name) -> Result<Sender, SendError> {
        self.sender_within(name, Reach::Here)
    }

    fn sender_within(self: &Arc<Self>, name: Name, reach: Reach) -> Result<Sender, SendError> {
        // Read before it is looked for: what comes in between makes this number an old one.
        let epoch = self.node().registry_epoch();
        let segment = open(self, name, reach)?;
        count_in(&mut self.sending(), name, &segment)?;
        let place = Place::of(self.claimant());
        let posts = Posts::new(&segment.shape);
        let flows = self.traffic().writer();
        Ok(Sender { participant: self.clone(), to: name, opened: name, segment, epoch, reach, place, posts, flows })
    }
}

/// The mailbox itself, or else that of the router which leads to it.
fn open(participant: &Participant, name: Name, reach: Reach) -> Result<Segment, SendError> {
    if let Some(here) = open_here(participant, name)? {
        return Ok(here);
    }
    if reach == Reach::Here {
        return Err(SendError::NoMailbox(name));
    }
    let route = routes::find(participant.node().directory(), name).map_err(|text| SendError::Bad(name, text))?;
    let router = route.ok_or(SendError::NoMailbox(name))?;
    open_here(participant, router)?.ok_or(SendError::NoRouter { name, router })
}

/// A mailbox of this node, if there is one of this name.
fn open_here(participant: &Participant, name: Name) -> Result<Option<Segment>, SendError> {
    match Segment::open(participant.node().directory(), name) {
        Ok(segment) => Ok(Some(segment)),
        Err(BadSegment::Io(error)) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(SendError::Bad(name, error.to_string())),
    }
}

/// Notes that this participant sends to one more mailbox, if there may be one more. One sender holds one claim at most.
fn count_in(sending: &mut Vec<Name>, to: Name, segment: &Segment) -> Result<(), SendError> {
    if sending.iter().filter(|n| **n == segment.name).count() >= usize::from(segment.shape.claims) {
        return Err(SendError::InUse(to));
    }
    sending.push(segment.name);
    Ok(())
}

fn count_out(sending: &mut Vec<Name>, segment: &Segment) {
    if let Some(at) = sending.iter().position(|name| *name == segment.name) {
        sending.swap_remove(at);
    }
}

impl Sender {
    /// The mailbox that packages are for, also if a router takes them there.
    pub fn name(&self) -> Name {
        self.to
    }

    /// From now on packages are for another name, by the same way, whatever else leads there: for a caller that sends
    /// by a router to names that others choose. Whether that router leads there is the caller's to know.
    pub fn readdress(&mut self, to: Name) {
        self.to = to;
    }

    /// Largest body it takes.
    pub fn body_bytes_max(&self) -> usize {
        usize::from(self.segment.shape.body_bytes_max)
    }

    /// Sends a package; its body is these parts, one after the other.
    ///
    /// # Errors
    /// When it was not accepted.
    // Put into its callers, which know how many parts there are.
    #[inline(always)]
    pub fn send(&mut self, label: &Label, parts: &[&[u8]]) -> Result<(), SendError> {
        let len = parts.iter().map(|part| part.len()).sum();
        let mut claim = match self.claim(label.priority, Some(label), len) {
            Ok(claim) => claim,
            Err(error) => return Err(self.refused(label, error)),
        };
        let mut body = self.segment.body_mut(&mut claim);
        for part in parts {
            let (here, rest) = body.split_at_mut(part.len());
            here.copy_from_slice(part);
            body = rest;
        }
        self.publish(claim, label, len)
    }

    /// Borrows a slot to write a package in place. Dropped unsent, the slot is free again. What it will replace in a
    /// `latest` mailbox is known only when it is sent; so in a full one it needs somebody to displace.
    ///
    /// # Errors
    /// [`SendError::Full`], or what reopening a replaced mailbox brings.
    pub fn loan(&mut self, priority: Priority) -> Result<Loan<'_>, SendError> {
        // Refused, it is counted in the mailbox alone: what it would have been was not said yet.
        let claim = self.claim(priority, None, 0)?;
        Ok(Loan { sender: self, claim: Some(claim), priority })
    }

    /// A slot for a body of `len` bytes.
    #[inline(always)]
    fn claim(&mut self, priority: Priority, label: Option<&Label>, len: usize) -> Result<Claim, SendError> {
        if self.is_routed() && self.participant.node().registry_epoch() != self.epoch {
            self.look_again()?;
        }
        match self.claim_here(priority, label, len) {
            Ok(claim) => Ok(claim),
            Err(why) => self.claim_elsewhere(why, priority, label, len),
        }
    }

    /// The same in the mailbox as it is. A body too large is refused before it pushes anybody out.
    #[inline(always)]
    fn claim_here(&mut self, priority: Priority, label: Option<&Label>, len: usize) -> Result<Claim, NoClaim> {
        let slots = self.segment.slots();
        if len > self.body_bytes_max() && !slots.is_retired() {
            return Err(NoClaim::TooLarge);
        }
        let (me, full) = (self.participant.claimant(), self.segment.shape.full);
        let old = label.and_then(|label| self.posts.of(label));
        let claim = slots.claim(me, self.place.first(slots.count()), priority, full, old).map_err(NoClaim::NoSlot)?;
        self.place.found(claim.slot(), slots.count());
        Ok(claim)
    }

    /// A mailbox that was given up is followed by the one that took its place.
    #[cold]
    fn claim_elsewhere(
        &mut self,
        mut why: NoClaim,
        priority: Priority,
        label: Option<&Label>,
        len: usize,
    ) -> Result<Claim, SendError> {
        for _ in 0..REOPEN_MAX {
            if let Some(refused) = self.refusal(&why, priority, len) {
                return Err(refused);
            }
            self.enter(open(&self.participant, self.opened, self.reach)?)?;
            match self.claim_here(priority, label, len) {
                Ok(claim) => return Ok(claim),
                Err(next) => why = next,
            }
        }
        Err(self.refusal(&why, priority, len).unwrap_or(SendError::NoMailbox(self.to)))
    }

    /// Why a mailbox that was not given up takes no package; a full one counts it.
    fn refusal(&self, why: &NoClaim, priority: Priority, len: usize) -> Option<SendError> {
        let (name, max) = (self.segment.name, self.body_bytes_max());
        if let NoClaim::NoSlot(NoSlot::Full) = why {
            self.segment.page().counters.lost(priority, Loss::Refused, 1);
        }
        match why {
            NoClaim::TooLarge => Some(SendError::TooLarge { name, len, max }),
            NoClaim::NoSlot(why) => (*why == NoSlot::Full).then_some(SendError::Full(name)),
        }
    }

    /// Whether a router takes the packages further.
    fn is_routed(&self) -> bool {
        self.segment.name != self.opened
    }

    /// Looks whether the mailbox is on this node by now, or another router leads to it: what is here goes before any
    /// route. As long as there is nothing better, it goes on as before.
    #[cold]
    fn look_again(&mut self) -> Result<(), SendError> {
        let epoch = self.participant.node().registry_epoch();
        let node = self.participant.node().directory();
        let router = || routes::find(node, self.opened).ok().flatten().filter(|router| *router != self.segment.name);
        let better = match open_here(&self.participant, self.opened)? {
            None => router().map(|router| open_here(&self.participant, router)).transpose()?.flatten(),
            here => here,
        };
        if let Some(better) = better {
            self.enter(better)?;
        }
        self.epoch = epoch;
        Ok(())
    }

    /// From now on sends there; the old segment is returned.
    fn enter(&mut self, successor: Segment) -> Result<Segment, SendError> {
        if successor.name != self.segment.name {
            let mut sending = self.participant.sending();
            count_in(&mut sending, self.to, &successor)?;
            count_out(&mut sending, &self.segment);
        }
        self.posts = Posts::new(&successor.shape);
        Ok(std::mem::replace(&mut self.segment, successor))
    }

    /// Publishes a filled claim; on a retired mailbox moves it to the one that took its place.
    #[inline(always)]
    fn publish(&mut self, claim: Claim, label: &Label, len: usize) -> Result<(), SendError> {
        match self.publish_here(claim, label, len) {
            Ok(()) => Ok(()),
            Err(NotHere::Retired(claim)) => self.publish_elsewhere(claim, label, len),
            Err(NotHere::Reclaimed) => Err(self.refused(label, SendError::Reclaimed(self.to))),
        }
    }

    #[inline(always)]
    fn publish_here(&mut self, mut claim: Claim, label: &Label, len: usize) -> Result<(), NotHere> {
        let published_ns = self.segment.write_head(&mut claim, &label.head(self.to, len));
        self.count_victim(&claim);
        let slots = self.segment.slots();
        if self.posts.of(label).is_some_and(|old| slots.replace(&mut claim, old)) {
            self.count_victim(&claim);
        }
        match slots.publish(claim, label.priority) {
            Published::Accepted { posted, wake } => {
                slots.expect_to_fill(self.place.next(slots.count()));
                self.posts.remember(label, posted, &slots);
                if wake {
                    self.wake();
                }
                step!("send: before count");
                self.flows.accepted(self.participant.traffic(), label.key(self.to), len, published_ns, 0);
                Ok(())
            }
            Published::Reclaimed => Err(NotHere::Reclaimed),
            Published::Retired(claim) => Err(NotHere::Retired(claim)),
        }
    }

    /// The mailbox was given up: follows it to the ones that took its place.
    #[cold]
    fn publish_elsewhere(&mut self, mut claim: Claim, label: &Label, len: usize) -> Result<(), SendError> {
        let name = self.to;
        for _ in 1..REOPEN_MAX {
            let moved = self.move_on(claim, label.priority, len);
            claim = moved.map_err(|error| self.refused(label, error))?;
            match self.publish_here(claim, label, len) {
                Ok(()) => return Ok(()),
                Err(NotHere::Retired(old)) => claim = old,
                Err(NotHere::Reclaimed) => return Err(self.refused(label, SendError::Reclaimed(name))),
            }
        }
        // Its victim is counted: `publish_here` does so first.
        self.segment.slots().abandon(claim);
        Err(self.refused(label, SendError::NoMailbox(name)))
    }

    /// Copies a claim of a retired mailbox into one of its successor.
    fn move_on(&mut self, mut old: Claim, priority: Priority, len: usize) -> Result<Claim, SendError> {
        let successor = open(&self.participant, self.opened, self.reach);
        let retired = match successor.and_then(|successor| self.enter(successor)) {
            Ok(retired) => retired,
            Err(error) => {
                self.segment.slots().abandon(old);
                return Err(error);
            }
        };
        if let Some(victim) = old.late_victim() {
            // Its loss is in counters that were carried over before: here it is counted again, once too often at worst.
            self.segment.page().counters.gave_way(victim);
        }
        let result = self.claim(priority, None, len).map(|mut claim| {
            self.segment.body_mut(&mut claim)[..len].copy_from_slice(&retired.body_mut(&mut old)[..len]);
            claim
        });
        retired.slots().abandon(old);
        result
    }

    /// Counts what was not accepted; its sender is told.
    #[cold]
    fn refused(&mut self, label: &Label, error: SendError) -> SendError {
        let key = label.key(self.name());
        self.flows.refused(self.participant.traffic(), key);
        error
    }

    fn count_victim(&self, claim: &Claim) {
        if let Some(victim) = claim.victim() {
            self.segment.page().counters.gave_way(victim);
        }
    }

    #[cold]
    fn wake(&self) {
        step!("send: before bell");
        let owner = self.segment.page().owner.participant.load(std::sync::atomic::Ordering::Relaxed);
        doorbell::ring(self.participant.node(), owner as u16);
        step!("send: rung");
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        self.flows.leave(self.participant.traffic());
        count_out(&mut self.participant.sending(), &self.segment);
    }
}

/// A slot to write a package in.
pub struct Loan<'a> {
    sender: &'a mut Sender,
    /// None once it was sent.
    claim: Option<Claim>,
    priority: Priority,
}

impl Loan<'_> {
    /// Room for the body; what was there before is somebody else's old package.
    pub fn body(&mut self) -> &mut [u8] {
        match &mut self.claim {
            Some(claim) => self.sender.segment.body_mut(claim),
            None => &mut [],
        }
    }

    /// Sends the first `len` bytes of the body. The label's priority is replaced by the one the slot was lent for.
    ///
    /// # Errors
    /// When it was not accepted.
    pub fn send(mut self, label: &Label, len: usize) -> Result<(), SendError> {
        let max = self.sender.body_bytes_max();
        if len > max {
            let error = SendError::TooLarge { name: self.sender.segment.name, len, max };
            return Err(self.sender.refused(label, error));
        }
        match self.claim.take() {
            Some(claim) => self.sender.publish(claim, &Label { priority: self.priority, ..*label }, len),
            None => Ok(()),
        }
    }
}

impl Drop for Loan<'_> {
    fn drop(&mut self) {
        if let Some(claim) = self.claim.take() {
            self.sender.count_victim(&claim);
            self.sender.segment.slots().abandon(claim);
        }
    }
}
