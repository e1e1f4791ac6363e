//! `rohrpost call`: calls a function of any module, using the module's own description.

use crate::look::target::{Running, Target};
use crate::measure::stream::too_large_for_data;
use crate::terminal::units::seconds;
use crate::terminal::{Failure, say, say_folded};
use rohrpost::common::{self, OutputLevel};
use rohrpost::output::plain;
use rohrpost::schema::{
    DataKind, Description, Function, Type, Value, decode, describe_field, describe_result, encode, is_word,
    parse_argument,
};
use rohrpost::{Name, ToolLink};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost call motor.0                    lists the functions and data of motor.0
  rohrpost call motor.0 drive 0.3 0.5      calls drive
  rohrpost call motor.0 off                one of the functions that every module has
  rohrpost call odometry.0 get odometry    asks for the newest data
Arguments are numbers, words, or JSON.")]
pub(crate) struct Arguments {
    /// Module, such as motor.0.
    name: String,
    /// Function; without it, list what the module offers.
    function: Option<String>,
    /// Its arguments.
    #[arg(allow_negative_numbers = true)]
    arguments: Vec<String>,
    #[command(flatten)]
    target: Target,
    /// Timeout for the answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Functions that every module has, in addition to those of its interface: what they do, and what they take.
pub(crate) const COMMON: [(&str, &str, &str); 5] = [
    ("on", "Starts its work", "nothing"),
    ("off", "Goes to its safe state", "nothing"),
    ("status", "Reports its state", "nothing"),
    ("get", "Returns the newest data of one kind", "the name of one kind of data"),
    ("output-level", "Sets which lines it sends", "one level (error, warn, info, debug or trace)"),
];

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.module(&arguments.name)?;
    let mut tool = running.join(seconds(arguments.timeout)?)?;
    let result = answer(arguments, &running, module, &mut tool);
    let (text, failed) = result.map_err(|error| running.told(module, &*error))?;
    if arguments.json {
        say(text)
    } else {
        say_folded(text)
    };
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The text to print, and whether the function itself reported an error.
fn answer(
    arguments: &Arguments,
    running: &Running,
    module: Name,
    tool: &mut ToolLink,
) -> Result<(String, bool), Failure> {
    let Some(name) = &arguments.function else {
        let description = tool.describe(module)?;
        let text = if arguments.json { serde_json::to_string(&description)? } else { listing(&description) };
        return Ok((text, false));
    };
    let value = match (name.as_str(), &arguments.arguments[..]) {
        ("on", []) => tool.switch(module, true).map(|()| Value::Null)?,
        ("off", []) => tool.switch(module, false).map(|()| Value::Null)?,
        ("status", []) => {
            let json = serde_json::to_value(tool.status(module)?)?;
            serde_json::from_value(json)?
        }
        ("output-level", [level]) => tool.output_level(module, level_of(level)?).map(|_| Value::Null)?,
        ("get", [data]) => get(running, module, data, tool)?,
        (common, texts) if let Some((.., right)) = COMMON.iter().find(|(name, ..)| *name == common) => {
            return Err(format!("`{common}` takes {right}, not {} arguments", texts.len()).into());
        }
        (_, texts) => call(module, name, texts, tool)?,
    };
    // A function's own error is an answer, too; scripts see it by the exit code.
    let (value, failed) = match value {
        Value::Variant(outcome, inner) if outcome == "Ok" => (*inner, false),
        Value::Variant(outcome, inner) if outcome == "Err" => (Value::Variant(outcome, inner), true),
        value => (value, false),
    };
    let text = match &value {
        _ if arguments.json => serde_json::to_string(&value)?,
        Value::Variant(_, why) if failed => format!("{} answers with an error: {why}", running.text(module)),
        Value::Null => "ok".into(),
        value => value.to_string(),
    };
    Ok((text, failed))
}

pub(crate) fn level_of(text: &str) -> Result<OutputLevel, Failure> {
    let level = OutputLevel::ALL.into_iter().find(|level| level.name() == text);
    level.ok_or_else(|| format!("no level `{text}`; there are error, warn, info, debug, trace").into())
}

fn get(running: &Running, module: Name, data: &str, tool: &mut ToolLink) -> Result<Value, Failure> {
    let description = tool.describe(module)?;
    let item = description.data_item(data).ok_or_else(|| {
        let names: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
        format!("no data `{data}`; it has: {}", names.join(", "))
    })?;
    if let Some(why) = too_large_for_data(running, module, item) {
        return Err(why);
    }
    let number = item.number;
    let write = |body: &mut Vec<u8>| rohrpost::wire::append(body, &(number,));
    let bytes = tool.call(module, common::GET_DATA, description.hash(), write, |bytes| Ok(bytes.to_vec()))?;
    // Behind the time, of which each byte but the last has its highest bit set.
    let end = bytes.iter().position(|byte| byte & 0x80 == 0).ok_or("the answer is too short")?;
    Ok(decode(&item.field.ty, &bytes[end + 1..])?)
}

fn call(module: Name, name: &str, texts: &[String], tool: &mut ToolLink) -> Result<Value, Failure> {
    let description = tool.describe(module)?;
    let function = description.function(name).ok_or_else(|| {
        let own: String = names(&description).iter().map(|name| format!("{name}, ")).collect();
        format!("no function `{name}`; it has: {own}on, off, status, get DATA, output-level LEVEL")
    })?;
    let body = body_of(function, texts)?;
    let write = |to: &mut Vec<u8>| {
        to.extend_from_slice(&body);
        Ok(())
    };
    let bytes = tool.call(module, function.number, description.hash(), write, |bytes| Ok(bytes.to_vec()))?;
    Ok(decode(&function.result, &bytes)?)
}

/// Names of a module's own functions.
pub(crate) fn names(description: &Description) -> Vec<&str> {
    description.functions.iter().map(|function| function.name.as_str()).collect()
}

/// Encodes arguments for a package.
pub(crate) fn body_of(function: &Function, texts: &[String]) -> Result<Vec<u8>, Failure> {
    if function.arguments.len() != texts.len() {
        return Err(
            format!("{} takes {} arguments, not {}", usage(function), function.arguments.len(), texts.len()).into()
        );
    }
    let mut body = Vec::new();
    for (argument, text) in function.arguments.iter().zip(texts) {
        let value = typed(&argument.ty, text).map_err(|error| format!("{}: {error}", plain::line(&argument.name)))?;
        body.extend(encode(&argument.ty, &value).map_err(|error| format!("{}: {error}", argument.name))?);
    }
    Ok(body)
}

/// What a user types for a value: JSON, if it begins as such and no word is a value of the type; else a word.
fn typed(ty: &Type, text: &str) -> Result<Value, Failure> {
    let is_json = match text.chars().next() {
        Some('{' | '[') => !is_word(some_of(ty)),
        // A text in quotes is the text.
        Some('"') => !is_word(ty) || serde_json::from_str::<String>(text).is_ok(),
        _ => false,
    };
    if is_json { Ok(serde_json::from_str(text)?) } else { Ok(parse_argument(ty, text)?) }
}

/// The type behind options.
fn some_of(ty: &Type) -> &Type {
    if let Type::Option(some) = ty { some_of(some) } else { ty }
}

/// A function with the names and types of its arguments.
pub(crate) fn usage(function: &Function) -> String {
    let arguments: Vec<String> =
        function.arguments.iter().map(|argument| format!(" <{}>", describe_field(argument))).collect();
    format!("{}{}", plain::line(&function.name), arguments.concat())
}

/// What a module offers, for people.
pub(crate) fn listing(description: &Description) -> String {
    let mut text = format!("class {}: {}\n", plain::line(&description.class), plain::line(&description.text));
    if !description.functions.is_empty() {
        text.push_str("\nfunctions\n");
    }
    for function in &description.functions {
        text.push_str(&format!(
            "  {} -> {}\n      {}\n",
            usage(function),
            describe_result(&function.result),
            plain::line(&function.text)
        ));
    }
    for (title, kind) in [("data", DataKind::Data), ("streams", DataKind::Stream)] {
        let items: Vec<_> = description.data.iter().filter(|item| item.kind == kind).collect();
        if !items.is_empty() {
            text.push_str(&format!("\n{title}\n"));
        }
        for item in items {
            text.push_str(&format!("  {}\n      {}\n", describe_field(&item.field), plain::line(&item.field.text)));
        }
    }
    text.push_str("\nevery module: on, off, status, get DATA, output-level LEVEL");
    text
}
