//! What a router counts, for whoever wants to know: packages, losses by cause, peers.
