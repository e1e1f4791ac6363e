//! One time for all nodes: synchronisation by a master, calibration, and an error bound that is kept (seed 002, 2.2.3).
