//! Packages that wait for the wire: 32 levels, and a quota for each sender (seed 002, 4.1.2).
