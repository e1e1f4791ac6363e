//! What a parameter may hold comes back from the file that `param save` writes: each type at its edges, in each
//! language.

use crate::c_modules::compiled;
use crate::harness::{OUTPUT, Place, program, run_if_launched};
use crate::process::Running;
use crate::python_node::package;
use rohrpost::parameter::ParameterSet;
use rohrpost::{Context, Module, ModuleError};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Edges>();
}

/// Words that differ in little.
#[rohrpost::choice]
#[derive(Clone, Copy, Debug)]
#[expect(non_camel_case_types, reason = "one that its own word does not name")]
enum Side {
    Left,
    StraightAhead,
    Straight_Ahead,
    X2,
}

#[rohrpost::parameters]
struct Settings {
    /// Of this type.
    #[parameter(default = 1)]
    a_u8: u8,
    /// Of this type.
    #[parameter(default = 1)]
    a_u16: u16,
    /// Of this type.
    #[parameter(default = 1)]
    a_u32: u32,
    /// Of this type.
    #[parameter(default = 1)]
    a_u64: u64,
    /// Of this type.
    #[parameter(default = 1)]
    a_i8: i8,
    /// Of this type.
    #[parameter(default = 1)]
    a_i16: i16,
    /// Of this type.
    #[parameter(default = 1)]
    a_i32: i32,
    /// Of this type.
    #[parameter(default = 1)]
    a_i64: i64,
    /// Of this type.
    #[parameter(default = 1.0)]
    a_f32: f32,
    /// Of this type.
    #[parameter(default = 1.0)]
    a_f64: f64,
    /// Of this type.
    #[parameter(default = true)]
    a_bool: bool,
    /// Of this type.
    #[parameter(default = "")]
    a_text: String,
    /// Of this type.
    #[parameter(default = Side::Left)]
    a_side: Side,
}

/// Has parameters.
#[rohrpost::interface(class = "probe")]
trait Edged {
    /// What the module itself makes of its parameter: a number that no file gives back.
    #[command(16)]
    fn break_a_f64(&mut self);
}

struct Edges(Settings);

impl Edged for Edges {
    fn break_a_f64(&mut self) {
        self.0.a_f64 = f64::NAN;
    }
}

impl Module for Edges {
    type Settings = Settings;
    type Interfaces = EdgedInterface;

    fn new(settings: Settings, _: &mut Context) -> Result<Self, ModuleError> {
        Ok(Self(settings))
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Some(&mut self.0)
    }
}

const PYTHON: &str = r#"#!/usr/bin/env python3
import enum
import rohrpost as rp


@rp.data
class Side(enum.Enum):
    Left = 0
    StraightAhead = 1
    Straight_Ahead = 2
    X2 = 3


class Edges(rp.Module, klass="probe"):
    """Has parameters."""

    a_u8: rp.U8 = rp.parameter(1)
    a_u16: rp.U16 = rp.parameter(1)
    a_u32: rp.U32 = rp.parameter(1)
    a_u64: rp.U64 = rp.parameter(1)
    a_i8: rp.I8 = rp.parameter(1)
    a_i16: rp.I16 = rp.parameter(1)
    a_i32: rp.I32 = rp.parameter(1)
    a_i64: rp.I64 = rp.parameter(1)
    a_f32: rp.F32 = rp.parameter(1.0)
    a_f64: float = rp.parameter(1.0)
    a_bool: bool = rp.parameter(True)
    a_text: str = rp.parameter("")
    a_side: Side = rp.parameter(Side.Left)


if __name__ == "__main__":
    rp.run(Edges)
"#;

const C: &str = r#"
#include "rohrpost.h"

static const rohrpost_data DATA[] = {ROHRPOST_PUBLISHED(1, "nothing", ROHRPOST_F64, "", "Never published.")};
static const rohrpost_interface EDGES = ROHRPOST_INTERFACE("Edged", "probe", "Has parameters.", ROHRPOST_NONE,
    ROHRPOST_ALL(DATA));
static const rohrpost_named SIDES[] = {
    ROHRPOST_VARIANT("Left", ""), ROHRPOST_VARIANT("StraightAhead", ""), ROHRPOST_VARIANT("Straight_Ahead", ""),
    ROHRPOST_VARIANT("X2", ""),
};
static const rohrpost_named SIDE = {"Side", "", ROHRPOST_MEMBERS_NONE, NULL, 0};
#define EDGE(name, type, value) {{name, type, "", "Of this type.", NULL, NULL}, value}
static const rohrpost_parameter PARAMETERS[] = {
    EDGE("a-u8", ROHRPOST_U8, "1"), EDGE("a-u16", ROHRPOST_U16, "1"), EDGE("a-u32", ROHRPOST_U32, "1"),
    EDGE("a-u64", ROHRPOST_U64, "1"), EDGE("a-i8", ROHRPOST_I8, "1"), EDGE("a-i16", ROHRPOST_I16, "1"),
    EDGE("a-i32", ROHRPOST_I32, "1"), EDGE("a-i64", ROHRPOST_I64, "1"), EDGE("a-f32", ROHRPOST_F32, "1"),
    EDGE("a-f64", ROHRPOST_F64, "1"), EDGE("a-bool", ROHRPOST_BOOL, "true"), EDGE("a-text", ROHRPOST_TEXT, ""),
    EDGE("a-side", ROHRPOST_ENUM(SIDE, SIDES), "Left"),
};

int main(int count, char **arguments) {
    static rohrpost_module module;
    module.interface = &EDGES;
    module.parameters = PARAMETERS;
    module.parameter_count = ROHRPOST_COUNT(PARAMETERS);
    return rohrpost_module_run(&module, count, (const char *const *)arguments);
}
"#;

/// Each parameter with its values, as JSON has them.
fn edges() -> Vec<(&'static str, Vec<Value>)> {
    let all = |values: &[f64]| values.iter().map(|value| json!(value)).collect();
    let texts = [
        "",
        "\u{0}\u{1}\u{1b}[2J\u{7f}\u{85}",
        "a\nb\r\nc\rd\te\u{8}\u{c}\\ \"'",
        "'''",
        "\"\"\"\n'''\n",
        "\n",
        " grüß dich, 🤖\u{2028}\u{feff} ",
        "null",
        "-1.5e3",
        "[1] # {x = 1}",
        "1979-05-27",
    ];
    vec![
        ("a-u8", vec![json!(u8::MAX), json!(0)]),
        ("a-u16", vec![json!(u16::MAX), json!(0)]),
        ("a-u32", vec![json!(u32::MAX), json!(0)]),
        ("a-u64", vec![json!(u64::MAX), json!(0), json!(1_u64 << 63), json!(i64::MAX)]),
        ("a-i8", vec![json!(i8::MIN), json!(i8::MAX)]),
        ("a-i16", vec![json!(i16::MIN), json!(i16::MAX)]),
        ("a-i32", vec![json!(i32::MIN), json!(i32::MAX)]),
        ("a-i64", vec![json!(i64::MIN), json!(i64::MAX)]),
        ("a-f32", all(&[3.402_823_5e38, -3.402_823_5e38, 1e-45, -0.0, 0.1])),
        ("a-f64", all(&[f64::MAX, f64::MIN, 5e-324, -0.0, 0.1, 1e16, -1e-300, 9_007_199_254_740_993.0])),
        ("a-bool", vec![json!(false), json!(true)]),
        ("a-text", texts.map(Value::from).into()),
        ("a-side", ["StraightAhead", "Straight_Ahead", "X2", "Left"].map(Value::from).into()),
    ]
}

/// A file with one value of each.
fn file_of(row: &[(&str, Value)]) -> String {
    let line = |(name, value): &(&str, Value)| format!("{name} = {}\n", value.to_string().replace('\u{7f}', "\\u007f"));
    let lines: String = row.iter().map(line).collect();
    format!("[\"probe.0\"]\n{lines}")
}

/// One robot, launched again and again.
struct Scene {
    place: Place,
    program: String,
    path: PathBuf,
}

impl Scene {
    fn launched(&self) -> Running {
        let module = |name: &str| format!("[[module]]\nname = \"{name}\"\nprogram = {}\n", self.program);
        let config = self.place.config(&[OUTPUT, &module("probe.0"), &module("probe.1")]);
        let text = std::fs::read_to_string(&config).unwrap();
        std::fs::write(&config, format!("parameters = \"tuned.toml\"\n{text}")).unwrap();
        let mut command = self.place.command(&["launch", config.to_str().unwrap()]);
        command.env("PYTHONPATH", &self.path).env("PYTHONDONTWRITEBYTECODE", "1");
        self.place.up(command, &config, "main").0
    }

    fn values(&self) -> Vec<(String, Value)> {
        let all = self.place.say(&["param", "get", "probe.0", "--json"]).json();
        let one = |entry: &Value| (entry["parameter"].as_str().unwrap().to_owned(), entry["value"].clone());
        all.as_array().unwrap().iter().map(one).collect()
    }

    /// Each edge is set by a file, saved, and there after the next start.
    fn survives(&self) {
        let mut launch = self.launched();
        let edges = edges();
        let rows = edges.iter().map(|(_, values)| values.len()).max().unwrap();
        for row in 0..rows {
            let row: Vec<(&str, Value)> =
                edges.iter().map(|(name, values)| (*name, values[row % values.len()].clone())).collect();
            self.place.write("edges.toml", file_of(&row));
            self.place.say(&["param", "load", "edges.toml"]).ok();
            let set = self.values();
            for ((name, value), (known, wanted)) in set.iter().zip(&row) {
                // Negative zero becomes zero.
                let wanted = if *wanted == json!(-0.0) { &json!(0.0) } else { wanted };
                assert_eq!((name.as_str(), value), (*known, wanted), "as it was set");
            }
            self.place.say(&["param", "save", "probe.0"]).ok();
            // One of another module alone: what is there of the first stays.
            self.place.say(&["param", "save", "probe.1"]).ok();
            launch.stop();
            launch = self.launched();
            let file = std::fs::read_to_string(self.place.path("tuned.toml")).unwrap();
            assert_eq!(self.values(), set, "after the next start with\n{file}");
            self.place.say(&["check", self.place.path("test.toml").to_str().unwrap()]).ok();
        }
        launch.stop();
    }
}

#[test]
fn what_a_parameter_in_rust_holds_survives_save_and_start() {
    let (place, path) = (Place::new(), PathBuf::new());
    Scene { place, program: program("param_edges::module"), path }.survives();
}

#[test]
fn what_a_parameter_in_python_holds_survives_save_and_start() {
    let place = Place::new();
    let (program, path) = (place.program("edges.py", PYTHON), package(&place));
    Scene { place, program: format!("{program:?}"), path }.survives();
}

#[test]
fn what_a_parameter_in_c_holds_survives_save_and_start() {
    let place = Place::new();
    place.write("edges.c", C);
    let program = format!("{:?}", compiled(&place, &place.path("edges.c")));
    Scene { place, program, path: PathBuf::new() }.survives();
}

#[test]
fn a_value_that_the_next_start_would_refuse_is_not_saved_and_told() {
    let (place, path) = (Place::new(), PathBuf::new());
    let scene = Scene { place, program: program("param_edges::module"), path };
    let mut launch = scene.launched();
    scene.place.say(&["call", "probe.0", "break_a_f64"]).ok();
    let said = scene.place.say(&["param", "save", "probe.0"]);
    let told = "probe.0: not saved, since its next start would refuse it: `a-f64` is NaN, out of range: f64\n";
    assert_eq!((said.code, said.err.as_str()), (Some(1), told), "{said:?}");
    assert!(said.out.ends_with("tuned.toml: probe.0 (12)\n"), "{said:?}");
    launch.stop();
    let mut launch = scene.launched();
    assert!(scene.values().contains(&("a-f64".into(), json!(1.0))), "its default");
    launch.stop();
}
