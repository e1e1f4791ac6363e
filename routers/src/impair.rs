//! A bad network, made from a seed: loss, delay, copies, reordering, a slow link, flipped bits.
