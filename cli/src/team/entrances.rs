//! `rohrpost entrances`: from which cells an intruder can be blocked, and how far they are.

use super::ground::{GroundArguments, cell_json};
use crate::terminal::table::table;
use crate::terminal::{Failure, complain, say};
use rohrpost_team::grid::{Cell, Entrance, Wave, entrances};
use serde_json::{Value, json};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost entrances lab.map --intruder 7,4 --from 2,2
  rohrpost entrances lab.map --intruder 7,4 --intruder 8,4 --from 2,2 --json
Cells are column,row, counted from 0 at the upper left of the file. The nearest entrance comes first; what robots, \
walls or the intruder itself part from the robot comes last, without a number of steps.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    ground: GroundArguments,
    /// Cell of the intruder; a larger one has several.
    #[arg(long, value_name = "C,R", required = true)]
    intruder: Vec<Cell>,
    /// Cell of the robot.
    #[arg(long, value_name = "C,R")]
    from: Cell,
    /// Print `entrances`, each with `cell` and `distance` in steps, as one JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let ground = arguments.ground.read()?;
    let (intruder, from) = (&arguments.intruder, arguments.from);
    let found = entrances(&mut Wave::default(), &ground.grid, intruder, from, &ground.obstacles)?;
    if arguments.json {
        let entrance = |found: &Entrance| json!({ "cell": cell_json(found.cell), "distance": found.distance });
        say(json!({ "entrances": found.iter().map(entrance).collect::<Value>() }));
    } else if !found.is_empty() {
        let steps = |found: &Entrance| found.distance.map_or("-".into(), |distance| distance.to_string());
        let rows = found.iter().map(|found| [found.cell.to_string(), steps(found)]);
        say(table(["entrance", ">steps"], rows).trim_end());
    }
    if found.iter().any(|entrance| entrance.distance.is_some()) {
        return Ok(ExitCode::SUCCESS);
    }
    complain(if found.is_empty() {
        "no path is beside the intruder; the map may be another, or the intruder elsewhere".to_owned()
    } else {
        format!("no entrance can be reached from {from}")
    });
    Ok(ExitCode::FAILURE)
}
