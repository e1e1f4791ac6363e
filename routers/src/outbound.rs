//! What goes to other nodes: which package next, in which datagram, and when.
