//! Handles what time alone causes: clients that are silent, stand still or take too long, and packages that waited in
//! vain.

use super::member::{Member, MemberState};
use super::work::WORK_SHARE;
use super::{Server, ServerEvent, ServerHost};
use crate::session::counts::Cause;
use crate::session::frame::SessionRefusalReason;
use crate::session::{ClientIndex, FRAME_MAX_NS, HANDSHAKE_MAX_NS, LOOK_EVERY_NS};
use crate::session::{SILENT_AFTER_NS, SLOW_SILENT_AFTER_NS, STALLED_AFTER_NS};

/// A look that comes so late says that the server stood still itself: that nothing was heard says nothing then.
const STOOD_STILL_NS: u64 = 4 * LOOK_EVERY_NS;

impl Server {
    pub(super) fn look(&mut self, now_ns: u64, host: &mut impl ServerHost) {
        let stood_still = self.looked_ns > 0 && now_ns > self.looked_ns + LOOK_EVERY_NS + STOOD_STILL_NS;
        self.looked_ns = now_ns;
        for index in 0..self.members.len() as u16 {
            let client = ClientIndex(index);
            let Some(member) = self.member_mut(client) else { continue };
            if stood_still {
                member.heard_ns = now_ns;
            }
            if member.outgoing.ready().is_empty() {
                member.moved_ns = now_ns;
            }
            if member.is_over(now_ns) {
                self.is_due(client);
            } else if let Some((reason, text)) = objection(now_ns, member) {
                self.refuse(now_ns, client, reason, (0, 0), text, host);
            } else {
                self.with_ledger(now_ns, client, host, |outgoing, ledger| outgoing.look(now_ns, Cause::Stale, ledger));
            }
        }
        self.places.principals.look(now_ns, WORK_SHARE);
        self.look_at_registrations(now_ns, host);
    }

    /// A member is none any more: nobody else waits for it from now on.
    pub(super) fn leave(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        why: Option<SessionRefusalReason>,
        host: &mut impl ServerHost,
    ) {
        let member = self.members.get(usize::from(client.0)).and_then(Option::as_deref);
        let Some(member) = member.filter(|member| member.is_member()) else { return };
        host.event(ServerEvent::Left { name: &member.name, why });
        self.places.leaves(now_ns, client, member);
        let (principal, ranges) = (member.principal_id, member.registrations.ranges);
        if ranges > 0 {
            self.table.remove(client);
            self.look_at_node(now_ns, client, host);
        }
        if let Some(uses) = self.places.principals.uses_mut(principal) {
            uses.ranges = uses.ranges.saturating_sub(ranges);
        }
        self.with_ledger(now_ns, client, host, |outgoing, ledger| outgoing.give_up(Cause::Gone, ledger));
    }
}

/// Why a client may not go on.
fn objection(now_ns: u64, member: &Member) -> Option<(SessionRefusalReason, &'static str)> {
    let since = |past_ns: u64| now_ns.saturating_sub(past_ns);
    let frame_ns = member.splitter.waits_since();
    let silent_after_ns = if frame_ns.is_some() { SLOW_SILENT_AFTER_NS } else { SILENT_AFTER_NS };
    match member.state {
        MemberState::Leaving { .. } => None,
        MemberState::Handshake => {
            (since(member.began_ns) > HANDSHAKE_MAX_NS).then_some((SessionRefusalReason::Silent, "no hello"))
        }
        MemberState::Member if since(member.heard_ns) > silent_after_ns => Some((SessionRefusalReason::Silent, "")),
        MemberState::Member if frame_ns.is_some_and(|began_ns| since(began_ns) > FRAME_MAX_NS) => {
            Some((SessionRefusalReason::Silent, "a frame did not end"))
        }
        MemberState::Member => {
            (since(member.moved_ns) > STALLED_AFTER_NS).then_some((SessionRefusalReason::Stalled, ""))
        }
    }
}
