//! Other systems that do a part of what mailboxes do, by their own public interfaces.
