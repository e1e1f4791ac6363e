//! Rohrpost.
