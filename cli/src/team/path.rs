//! `rohrpost path`: the shortest path of a robot on a map, around others.

use super::ground::{GroundArguments, cell_json};
use crate::terminal::units::counted;
use crate::terminal::{Failure, say};
use rohrpost_team::grid::{Cell, Wave, shortest_path};
use serde_json::{Value, json};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost path lab.map --from 2,2 --to 12,7
  rohrpost path lab.map --from 2,2 --to 12,7 --robots robots.txt --json
Cells are column,row, counted from 0 at the upper left of the file. Of equal paths the one counts that goes north \
before east before south before west. A robot passes another only where that one moves the same way.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    ground: GroundArguments,
    /// Cell of the robot.
    #[arg(long, value_name = "C,R")]
    from: Cell,
    /// Goal; of several, the nearest counts.
    #[arg(long, value_name = "C,R", required = true)]
    to: Vec<Cell>,
    /// Print `length` in steps and `cells` as one JSON object; without a path, `reason`.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let ground = arguments.ground.read()?;
    let found = shortest_path(&mut Wave::default(), &ground.grid, arguments.from, &arguments.to, &ground.obstacles);
    let cells = match found {
        Ok(cells) => cells,
        Err(none) if arguments.json => {
            say(json!({ "length": null, "cells": [], "reason": none.to_string() }));
            return Ok(ExitCode::FAILURE);
        }
        Err(none) => return Err(none.into()),
    };
    let length = cells.len() - 1;
    if arguments.json {
        let cells: Value = cells.into_iter().map(cell_json).collect();
        say(json!({ "length": length, "cells": cells }));
    } else {
        let cells: Vec<String> = cells.iter().map(Cell::to_string).collect();
        say(format_args!("{}\n{}", counted(length as u64, "step"), cells.join(" ")));
    }
    Ok(ExitCode::SUCCESS)
}
