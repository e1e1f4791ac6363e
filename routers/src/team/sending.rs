//! What a router of the team sends.

use super::frame::{Beat, TEAM_BODY_BYTES_MAX, TeamHead, TeamKind};
use super::member::TeamMember;
use super::{BEAT_NS, BEAT_SOON_NS, TEAM_SILENT_NS, TeamRouter, TeamSettings};
use crate::frame::{self, HEAD_BYTES};
use crate::security::TAG_BYTES;
use crate::session::Cause;
use rohrpost_mailbox::{ALL_SYSTEMS, Head};

impl TeamRouter {
    /// Writes the datagram of a package of this node for another system, or for all. Its head is one that
    /// [`capped`](crate::admission::capped) has been applied to.
    ///
    /// # Errors
    /// Why it cannot go this way; [`Self::left`] counts it.
    pub fn send(&mut self, head: &Head, body: &[u8], datagram: &mut Vec<u8>) -> Result<(), Cause> {
        let to = head.to.system();
        let is_reached = |reached: &Vec<u8>| to == ALL_SYSTEMS || reached.binary_search(&to).is_ok();
        if !self.settings.reached.as_ref().is_none_or(is_reached) {
            return Err(Cause::NoRoute);
        }
        if body.len() > TEAM_BODY_BYTES_MAX {
            return Err(Cause::TooLarge);
        }
        self.begin(TeamKind::Package, to, datagram);
        datagram.extend(Head { len: body.len() as u16, ..*head }.to_bytes());
        datagram.extend(body);
        self.close(datagram);
        Ok(())
    }

    /// Counts what became of a package of this node that was to leave, by this way or another.
    pub fn left(&mut self, head: &Head, outcome: Result<(), Cause>) {
        self.counts.out.came(head.priority);
        match outcome {
            Ok(()) => self.counts.out.passed(head.priority),
            Err(cause) => self.counts.out.lost(head.priority, cause),
        }
    }

    /// Writes a beat, if one is due.
    ///
    /// # Errors
    /// When the next one is, monotonic ns.
    pub fn poll(&mut self, now_ns: u64, datagram: &mut Vec<u8>) -> Result<(), u64> {
        if now_ns < self.next_beat_ns {
            return Err(self.next_beat_ns);
        }
        let challenge = self.challenges.present(now_ns);
        self.last_beat_ns = now_ns;
        self.next_beat_ns = now_ns + BEAT_NS - self.challenges.jitter(BEAT_NS / 8);
        let sent = self.sent_to_all;
        self.begin(TeamKind::Beat, ALL_SYSTEMS, datagram);
        let since_ns = now_ns.saturating_sub(TEAM_SILENT_NS);
        let echoes = self.members.iter().flat_map(|member: &TeamMember| member.echoes(since_ns));
        Beat::write(challenge, sent, echoes, datagram);
        self.close(datagram);
        Ok(())
    }

    /// Somebody new was heard, and is to hear this router soon.
    pub(super) fn hurry(&mut self) {
        let soon_ns = self.last_beat_ns + BEAT_SOON_NS + self.challenges.jitter(BEAT_SOON_NS);
        self.next_beat_ns = self.next_beat_ns.min(soon_ns);
    }

    fn begin(&mut self, kind: TeamKind, to: u8, datagram: &mut Vec<u8>) {
        let TeamSettings { system, node, common, incarnation, .. } = self.settings;
        let head = TeamHead { kind, system, node, to, common, incarnation, sequence: self.sequence };
        datagram.clear();
        datagram.resize(HEAD_BYTES, 0);
        head.write(datagram);
        self.sent_to_all += u64::from(to == ALL_SYSTEMS);
    }

    fn close(&mut self, datagram: &mut Vec<u8>) {
        match (&self.seal, &self.settings.keys) {
            (Some(seal), Some(keys)) => {
                datagram.resize(datagram.len() + TAG_BYTES, 0);
                seal.close(keys, self.sequence, datagram);
            }
            _ => frame::write_check(datagram),
        }
        self.sequence += 1;
    }
}
