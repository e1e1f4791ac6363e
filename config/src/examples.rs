//! Texts of the shipped example configurations, which `rohrpost demo` runs.

/// A simulated robot on one node, `demo.toml`.
pub const SIMULATION: &str = include_str!("../demo.toml");
/// A robot's log in the place of the simulation, `demo-log.toml`.
pub const LOG: &str = include_str!("../demo-log.toml");
/// The simulated robot on three nodes, `demo-nodes.toml`.
pub const NODES: &str = include_str!("../demo-nodes.toml");
/// A supervised robot with programs and nodes that fail, `demo-chaos.toml`.
pub const CHAOS: &str = include_str!("../demo-chaos.toml");
/// Three nodes in time slots, `demo-tdma.toml`.
pub const TDMA: &str = include_str!("../demo-tdma.toml");
/// A node with the GUI behind the TCP router, `demo-tcp.toml`.
pub const TCP: &str = include_str!("../demo-tcp.toml");
/// Walls of the simulated building, `building.map`, which the simulations name in their settings.
pub const BUILDING: &str = include_str!("../building.map");
