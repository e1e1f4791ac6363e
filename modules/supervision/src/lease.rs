//! Which one of several candidates runs a module: a lease, granted by one witness, so that there are never two.
//!
//! ```text
//!  Candidate (holder)  ── Ask, asked at t ──▶  Witness  ── from its arrival on: nobody else for one lease
//!                      ◀── Answer to t ──────            (measured on the witness's clock)
//!  from t on, for one lease less both clocks' errors
//!  and the time to be off: it holds
//!
//!  Candidate (holder)  ── data with its Number ──▶  Fence   refuses what an earlier holder sends late
//! ```
//!
//! What holds, whatever messages are lost, late, doubled or out of order, and whatever restarts:
//!
//! - **Never two.** The holder measures from when it asked, the witness from when it heard that. If no clock's rate is
//!   wrong by more than [`Terms::rate_error_ppm`], the holder's time is over before the witness's time.
//! - **A restarted witness** knows none of its grants. It waits for [`LEASE_MAX_NS`], then each of them is over.
//! - **A stopped holder** (SIGSTOP, a suspended computer) cannot see that its time is over. Each [`Fence`] refuses its
//!   numbers once it has let a newer one pass, or has heard of one from the witness; until then it lets them pass.
//!   Numbers rise in one run of the witness. Those of another run are let pass only after a question to the witness: so
//!   nothing has to be stored, and no file can be lost or old.
//! - **No ping-pong.** A better choice that comes back stands by. Only when the lease is free the order counts.
//!
//! A dead witness ends each lease that it gave. Two witnesses at a time are the one thing that must not be: a node's
//! lock on the module's name sees to that.
//!
//! C. G. Gray and D. R. Cheriton, *Leases*, SOSP 1989; numbers as fences: M. Burrows, *The Chubby lock service*, OSDI
//! 2006 ("sequencers").

mod candidate;
mod fence;
mod message;
mod terms;
mod witness;

pub use candidate::Candidate;
pub use fence::{Fence, Fenced};
pub use message::{ANSWER_BYTES, ASK_BYTES, Answer, Ask, Number, Wish};
pub use terms::{BadTerms, LEASE_MAX_NS, Terms};
pub use witness::{CANDIDATES_MAX, Witness};
