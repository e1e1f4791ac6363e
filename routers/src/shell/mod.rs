//! Threads and sockets around the cores.
