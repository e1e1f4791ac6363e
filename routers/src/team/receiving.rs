//! What a router of the team believes and delivers.

use super::counts::TeamRefusal;
use super::frame::{self, BadTeamFrame, Beat, TeamHead, TeamKind};
use super::member::TeamMember;
use super::two_ways::Way;
use super::{MEMBERS_MAX, REPLIES_MAX, TEAM_SILENT_NS, TeamHost, TeamRouter, TeamSettings};
use crate::admission::{ArrivalPath, NotAdmitted, capped};
use crate::frame::HEAD_BYTES;
use crate::security::TeamSeal;
use crate::session::{Cause, answer_to, in_system};
use rohrpost_mailbox::{ALL_SYSTEMS, Head};
use std::net::SocketAddr;

/// Beats of one incarnation that proves nothing for which this router answers soon.
const HASTE_MAX: u32 = 16;

impl From<BadTeamFrame> for TeamRefusal {
    fn from(bad: BadTeamFrame) -> Self {
        match bad {
            BadTeamFrame::Foreign => Self::Foreign,
            BadTeamFrame::Version(_) => Self::Version,
            BadTeamFrame::Damaged => Self::Damaged,
        }
    }
}

impl TeamRouter {
    /// Takes a datagram, which is opened where it lies.
    pub fn handle(&mut self, now_ns: u64, source: SocketAddr, datagram: &mut [u8], host: &mut impl TeamHost) {
        self.counts.came.add(1);
        if let Err(why) = self.take(now_ns, source, datagram, host) {
            self.counts.refuse(why);
        }
    }

    /// Takes a package of another system that came by the TCP router; its client has admitted it.
    pub fn by_tcp(&mut self, now_ns: u64, head: &Head, body: &[u8], host: &mut impl TeamHost) {
        self.enter(now_ns, Way::Tcp, head, body, host);
    }

    fn take(
        &mut self,
        now_ns: u64,
        source: SocketAddr,
        datagram: &mut [u8],
        host: &mut impl TeamHost,
    ) -> Result<(), TeamRefusal> {
        let (head, key) = TeamHead::read(datagram)?;
        let TeamSettings { system, node, common, incarnation, .. } = self.settings;
        // What this computer sends to a group it hears itself; and the nodes of a system have a way of their own.
        let is_own = head.system == system && (head.node != node || head.incarnation == incarnation);
        if is_own || head.to != system && head.to != ALL_SYSTEMS {
            return Ok(());
        }
        let text = match &self.settings.keys {
            None if key != 0 => return Err(TeamRefusal::Sealed),
            None => &datagram[HEAD_BYTES..],
            Some(keys) => {
                let place = keys.place(key).ok_or(TeamRefusal::Unsealed)?;
                self.open(now_ns, source, (&head, place), datagram)?
            }
        };
        if head.system == system {
            return Err(TeamRefusal::OwnName);
        }
        if head.common != 0 && head.common != common {
            return Err(TeamRefusal::Classes);
        }
        match head.kind {
            TeamKind::Beat => {
                let beat = Beat::parse(text).ok_or(TeamRefusal::Damaged)?;
                self.hear(now_ns, source, &head, &beat)
            }
            TeamKind::Package => {
                let (package, body) = frame::package(text).ok_or(TeamRefusal::Damaged)?;
                if package.from.system() != head.system || package.to.system() != head.to {
                    return Err(TeamRefusal::Damaged);
                }
                self.believe(now_ns, source, &head, None)?;
                self.enter(now_ns, Way::Team, &package, body, host);
                Ok(())
            }
        }
    }

    /// Opens a sealed datagram: anything of an incarnation that is believed, and of others their beats alone.
    fn open<'d>(
        &mut self,
        now_ns: u64,
        source: SocketAddr,
        (head, place): (&TeamHead, usize),
        datagram: &'d mut [u8],
    ) -> Result<&'d [u8], TeamRefusal> {
        let member = self.members.iter().find(|member| member.is(head));
        let present = member.and_then(|member| member.present.as_ref());
        if let Some(present) = present.filter(|present| present.incarnation == head.incarnation) {
            if present.has(head.sequence) {
                return Err(TeamRefusal::Duplicate);
            }
            let opened = present.seal.as_ref().and_then(|seal| seal.open(place, head.sequence, datagram));
            return opened.ok_or(TeamRefusal::Unsealed);
        }
        if head.kind != TeamKind::Beat {
            return Err(TeamRefusal::Unproven);
        }
        if let Some(candidate) = member.and_then(|member| member.candidate(head.incarnation)) {
            return candidate.seal.open(place, head.sequence, datagram).ok_or(TeamRefusal::Unsealed);
        }
        let Some(keys) = &self.settings.keys else { return Err(TeamRefusal::Unsealed) };
        let seal = TeamSeal::new(keys, head.system, head.node, head.incarnation);
        let opened = seal.open(place, head.sequence, datagram).ok_or(TeamRefusal::Unsealed)?;
        if head.system == self.settings.system {
            return Err(TeamRefusal::OwnName);
        }
        let member = Self::member(&mut self.members, now_ns, source, head)?;
        if member.add_candidate(now_ns, head.incarnation, seal) { Ok(opened) } else { Err(TeamRefusal::Crowded) }
    }

    /// The member that a head is from. A new one takes a free place, or that of the one that is silent for longest.
    fn member<'m>(
        members: &'m mut Vec<TeamMember>,
        now_ns: u64,
        source: SocketAddr,
        head: &TeamHead,
    ) -> Result<&'m mut TeamMember, TeamRefusal> {
        let place = match members.iter().position(|member| member.is(head)) {
            Some(place) => place,
            None if members.len() < MEMBERS_MAX => {
                members.push(TeamMember::new(now_ns, head, source));
                members.len() - 1
            }
            None => {
                let oldest = members.iter().enumerate().min_by_key(|(_, member)| member.heard_ns);
                let (place, _) = oldest
                    .filter(|(_, member)| now_ns.saturating_sub(member.heard_ns) > TEAM_SILENT_NS)
                    .ok_or(TeamRefusal::Crowded)?;
                members[place] = TeamMember::new(now_ns, head, source);
                place
            }
        };
        Ok(&mut members[place])
    }

    /// Takes the beat of an incarnation that is believed, or that may prove by it that it lives.
    fn hear(&mut self, now_ns: u64, source: SocketAddr, head: &TeamHead, beat: &Beat<'_>) -> Result<(), TeamRefusal> {
        let TeamSettings { system, node, .. } = self.settings;
        let mut ours = beat.echoes().filter(|echo| (echo.system, echo.node) == (system, node));
        let hears_us = ours.any(|echo| self.challenges.proves(now_ns, echo.challenge));
        let is_sealed = self.settings.keys.is_some();
        let Some(member) = self.members.iter_mut().find(|member| member.is(head)).filter(|_| is_sealed) else {
            self.believe(now_ns, source, head, Some(beat))?;
            return self.note(head, beat, hears_us);
        };
        if member.present.as_ref().is_none_or(|present| present.incarnation != head.incarnation) {
            let beats = member.heard_as_candidate(now_ns, head.incarnation, beat.challenge);
            if hears_us && !member.promote(now_ns, head.incarnation, head.sequence) {
                return Err(TeamRefusal::Duplicate);
            }
            if hears_us || beats <= HASTE_MAX {
                self.hurry();
            }
            if !hears_us {
                return Ok(());
            }
        }
        self.believe(now_ns, source, head, Some(beat))?;
        self.note(head, beat, hears_us)
    }

    /// Keeps what the beat of a present incarnation says.
    fn note(&mut self, head: &TeamHead, beat: &Beat<'_>, hears_us: bool) -> Result<(), TeamRefusal> {
        let member = self.members.iter_mut().find(|member| member.is(head));
        if let Some(present) = member.and_then(|member| member.present.as_mut()) {
            (present.challenge, present.hears_us) = (Some(beat.challenge), hears_us);
        }
        Ok(())
    }

    /// Takes the sequence of a datagram. Where nothing is sealed, its incarnation is believed by that.
    fn believe(
        &mut self,
        now_ns: u64,
        source: SocketAddr,
        head: &TeamHead,
        beat: Option<&Beat<'_>>,
    ) -> Result<(), TeamRefusal> {
        let is_sealed = self.settings.keys.is_some();
        let member = Self::member(&mut self.members, now_ns, source, head)?;
        let is_present = member.present.as_ref().is_some_and(|present| present.incarnation == head.incarnation);
        if !is_present {
            if is_sealed {
                return Err(TeamRefusal::Unproven);
            }
            if member.has_just_ended(now_ns, head.incarnation) {
                return Err(TeamRefusal::Ended);
            }
            member.believe(now_ns, head.incarnation, head.sequence);
        }
        if !member.present.as_mut().is_some_and(|present| present.arrive(head, beat)) {
            return Err(TeamRefusal::Duplicate);
        }
        (member.heard_ns, member.address) = (now_ns, source);
        if !is_present {
            self.hurry();
        }
        Ok(())
    }

    /// Delivers a package, if this node hosts its mailbox, and it may, and has not come by the other way.
    fn enter(&mut self, now_ns: u64, way: Way, package: &Head, body: &[u8], host: &mut impl TeamHost) {
        let own = self.settings.system;
        let head = Head { to: in_system(package.to, own), ..capped(package) };
        // Another node of the system may have it.
        if !host.hosts(head.to) {
            return;
        }
        let admission = &self.settings.admission;
        let admitted = admission.validate(ArrivalPath::Beyond { is_our_name: head.from.system() == own }, &head, body);
        let is_first = |two_ways: &mut super::TwoWays| two_ways.is_first(now_ns, way, &head, body);
        if admitted.is_ok() && !self.two_ways.as_mut().is_none_or(is_first) {
            self.counts.copies.add(1);
            return;
        }
        if admitted == Err(NotAdmitted::NotAllowed) {
            host.not_allowed(admission.rule_against(&head).map(|rule| rule.line));
        }
        self.counts.inn.came(head.priority);
        let entered = admitted.map_err(Cause::from).and_then(|()| host.deliver(&head, body).map_err(Cause::from));
        match entered {
            Ok(()) => self.counts.inn.passed(head.priority),
            Err(cause) => {
                self.counts.inn.lost(head.priority, cause);
                let is_for_one = package.to.system() != ALL_SYSTEMS && self.replies.len() < REPLIES_MAX;
                let reply = is_for_one.then(|| answer_to(&head, body, cause, None, host)).flatten();
                self.replies.extend(reply);
            }
        }
    }
}
