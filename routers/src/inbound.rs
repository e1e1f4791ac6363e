//! What comes from other nodes: who sent it, what is missing, what came twice, and where it goes.
