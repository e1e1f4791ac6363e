//! A network of up to 64 nodes from a seed, in virtual time, with whatever can go wrong in one.
