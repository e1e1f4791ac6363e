//! Systems that reach each other by the multicast group of `[team]`: real routers of teams, and robots that only say
//! and hear.
//!
//! ```text
//!  ping ─▶ team-router of `near` ══ multicast, veth ══▶ team-router of `far` ─▶ pong     one at a time
//!  64 robots ─▶ 64 routers ══ multicast, loopback ══▶ 64 routers ─▶ 64 robots            twice a second each
//!  64 sockets ═════════════ multicast, loopback ══▶ 64 relays ───▶ 64 robots            `relay`: the least router
//!  64 sockets ═════════════ multicast, loopback ══════════════════▶ 64 sockets           `bare`: the kernel alone
//! ```
//! All drawn programs are processes of their own.

pub mod bare;
pub mod relay;
pub mod robots;
pub mod systems;
