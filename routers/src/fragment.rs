//! Packages that do not fit in a datagram: cut up here, put together there, bounded in memory and time.
