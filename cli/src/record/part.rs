//! Which part of a recording is meant.

use super::time::{RecordTime, parse_time};
use rohrpost_recording::{Info, Selection};

/// A time range.
#[derive(clap::Args)]
pub(crate) struct PartArguments {
    /// What arrived from then on: seconds since 1970, from the start (+10s), or before the end (-10s).
    #[arg(long, value_name = "TIME", value_parser = parse_time, allow_hyphen_values = true)]
    from: Option<RecordTime>,
    /// What arrived before then.
    #[arg(long, alias = "to", value_name = "TIME", value_parser = parse_time, allow_hyphen_values = true)]
    until: Option<RecordTime>,
}

impl PartArguments {
    /// Of these names in a file.
    pub(crate) fn of(&self, info: &Info, names: &[String]) -> Selection {
        Selection {
            from_ns: self.from.map(|time| time.in_file(info)),
            until_ns: self.until.map(|time| time.in_file(info)),
            names: names.to_vec(),
            ..Selection::default()
        }
    }
}
