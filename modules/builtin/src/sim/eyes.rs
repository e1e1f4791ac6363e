//! The scanner of the simulated robot, and how it fails when it is asked to.

use rohrpost_modules::types::LaserScan;
use rohrpost_robot::simulator::Simulator;

/// How the scanner works: to try how a robot copes with one that fails.
#[rohrpost_modules::choice(crate = rohrpost_modules::macro_support)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ScannerHealth {
    /// As it should.
    #[default]
    Works,
    /// Gives no scan.
    Dead,
    /// Gives one scan's readings again and again, with new times.
    Frozen,
    /// Gives scans without a reading.
    Blind,
}

/// The scanner.
#[derive(Default)]
pub(super) struct Eyes {
    frozen: Option<LaserScan>,
}

impl Eyes {
    /// What the scanner gives now, if anything.
    pub(super) fn scan(&mut self, health: ScannerHealth, simulator: &mut Simulator) -> Option<LaserScan> {
        match health {
            ScannerHealth::Works => {
                self.frozen = None;
                Some(simulator.scan())
            }
            ScannerHealth::Dead => None,
            ScannerHealth::Frozen => Some(self.frozen.get_or_insert_with(|| simulator.scan()).clone()),
            ScannerHealth::Blind => {
                let mut scan = simulator.scan();
                scan.ranges_m.fill(0.0);
                Some(scan)
            }
        }
    }
}
