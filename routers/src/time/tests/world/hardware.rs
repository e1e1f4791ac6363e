//! Oscillators, and the faults of network and computers.

use super::MS;

/// An oscillator: local time as a function of true time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Oscillator {
    pub(super) offset_ns: u64,
    pub(super) rate_ppb: i64,
    /// The rate swings by this much, with this period.
    pub(super) wander_ppb: f64,
    pub(super) period_ns: f64,
    pub(super) phase: f64,
}

impl Oscillator {
    pub(super) fn local_ns(&self, true_ns: u64) -> u64 {
        let swing = |t: f64| {
            let turn = std::f64::consts::TAU / self.period_ns;
            -(turn * t + self.phase).cos() * self.wander_ppb * 1e-9 / turn
        };
        let even = i128::from(true_ns) + i128::from(true_ns) * i128::from(self.rate_ppb) / 1_000_000_000;
        let local = i128::from(self.offset_ns) + even + (swing(true_ns as f64) - swing(0.0)) as i128;
        u64::try_from(local).unwrap()
    }
}

/// Faults of the network and the computers.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Conditions {
    pub(in super::super) delay_ns: u64,
    /// Extra delay to nodes with a higher index.
    pub(in super::super) asymmetry_ns: u64,
    pub(in super::super) jitter_ns: u64,
    /// Per thousand.
    pub(in super::super) loss: u32,
    pub(in super::super) twice: u32,
    pub(in super::super) kernel_stamps: bool,
    /// Wake-up delay of a thread, now and then ten times as long.
    pub(in super::super) wakeup_ns: u64,
}

impl Conditions {
    pub(in super::super) const LAN: Self = Self {
        delay_ns: 15_000,
        asymmetry_ns: 3_000,
        jitter_ns: 20_000,
        loss: 0,
        twice: 0,
        kernel_stamps: true,
        wakeup_ns: 40_000,
    };
    pub(in super::super) const BAD: Self =
        Self { delay_ns: 2 * MS, asymmetry_ns: 200_000, jitter_ns: MS, loss: 50, twice: 10, ..Self::LAN };
}
