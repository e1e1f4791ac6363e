//! Reads, checks and explains the configuration of an installation.
