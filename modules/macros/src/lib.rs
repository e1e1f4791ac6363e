//! The `interface` and `data` attributes.
