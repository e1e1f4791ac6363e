//! How long a lease is, and what is known of clocks.

/// Longest lease, ns. A restarted witness waits for this time, since a lease of the run before may be of an older
/// configuration.
pub const LEASE_MAX_NS: u64 = 2_000_000_000;

/// Largest error of a clock's rate that can be stated, parts per million. Quartz clocks have less than 100.
const RATE_ERROR_MAX_PPM: u64 = 100_000;

const MILLION: u64 = 1_000_000;

// What is multiplied below is no larger than 64 bits.
const _: () = assert!(LEASE_MAX_NS < u64::MAX / (2 * MILLION));

/// Times of a lease, the same for witness and candidates.
///
/// ```
/// use rohrpost_supervision::lease::Terms;
/// let terms = Terms::new(1_000_000_000, 200_000_000, 50_000_000, 100)?;
/// // Two errors of 100 ppm, and 50 ms in which the holder gets off.
/// assert_eq!(terms.held_ns(1_000_000_000), 949_800_019);
/// # Ok::<(), rohrpost_supervision::lease::BadTerms>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Terms {
    lease_ns: u64,
    ask_every_ns: u64,
    off_ns: u64,
    rate_error_ppm: u32,
}

/// Why times do not make a lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadTerms {
    /// No time, or too much of it.
    #[error("a lease lasts {0} ns; it must be from 1 ns to {LEASE_MAX_NS} ns")]
    Lease(u64),
    /// No clock is so bad.
    #[error("a clock is wrong by {0} ppm; at most {RATE_ERROR_MAX_PPM} ppm can be stated")]
    RateError(u32),
    /// One lost question would end a lease.
    #[error("of a lease the holder has {held_ns} ns; in this time it must ask three times, every {ask_every_ns} ns")]
    Asks {
        /// What clocks and the way to off leave of a lease.
        held_ns: u64,
        /// Time between two questions.
        ask_every_ns: u64,
    },
}

impl Terms {
    /// Times that fit together.
    ///
    /// - `lease_ns`: so long the witness grants to nobody else after it has heard the holder.
    /// - `ask_every_ns`: how often a candidate asks.
    /// - `off_ns`: so long the module needs at most to be off.
    /// - `rate_error_ppm`: no clock is faster or slower than true time by more than this.
    ///
    /// # Errors
    /// If a lease is too long, or so short that one lost question would end it.
    pub fn new(lease_ns: u64, ask_every_ns: u64, off_ns: u64, rate_error_ppm: u32) -> Result<Self, BadTerms> {
        if lease_ns == 0 || lease_ns > LEASE_MAX_NS {
            return Err(BadTerms::Lease(lease_ns));
        }
        if rate_error_ppm as u64 > RATE_ERROR_MAX_PPM {
            return Err(BadTerms::RateError(rate_error_ppm));
        }
        let terms = Self { lease_ns, ask_every_ns, off_ns, rate_error_ppm };
        let held_ns = terms.held_ns(lease_ns);
        if ask_every_ns == 0 || ask_every_ns > held_ns / 3 {
            return Err(BadTerms::Asks { held_ns, ask_every_ns });
        }
        Ok(terms)
    }

    /// How long a lease lasts on the witness's clock, ns.
    pub fn lease_ns(&self) -> u64 {
        self.lease_ns
    }

    /// Time between two questions of a candidate, ns.
    pub fn ask_every_ns(&self) -> u64 {
        self.ask_every_ns
    }

    /// Largest error of a clock's rate, parts per million.
    pub fn rate_error_ppm(&self) -> u32 {
        self.rate_error_ppm
    }

    /// How long after its question the holder of a lease of `lease_ns` may be on, ns on its own clock.
    ///
    /// A clock that is slow by e shows `t (1 - e)` after the time t, one that is fast shows `t (1 + e)`.
    pub fn held_ns(&self, lease_ns: u64) -> u64 {
        let lease_ns = if lease_ns > LEASE_MAX_NS { LEASE_MAX_NS } else { lease_ns };
        let error = self.rate_error_ppm as u64;
        (lease_ns * (MILLION - error) / (MILLION + error)).saturating_sub(self.off_ns)
    }
}
