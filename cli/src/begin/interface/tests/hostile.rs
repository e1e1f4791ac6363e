//! Descriptions that somebody made to break what is generated: each is refused in words, or its code means nothing else
//! than it should.

use super::super::blueprint::Blueprint;
use super::super::python::OF_MODULES;
use super::super::refusal::{DEPTH_MAX, NAME_BYTES_MAX};
use super::{Language, generated};
use rohrpost::schema::{DataItem, DataKind, Description, Field, Function, Members, Named, Type};
use std::process::{Command, Stdio};

const LANGUAGES: [Language; 3] = [Language::Rust, Language::Python, Language::C];

fn structure(name: &str, fields: Vec<Field>) -> Type {
    Type::Struct(Named::new(name, Members::Fields(fields)))
}

fn function(number: u16, name: &str, arguments: Vec<Field>, result: Type) -> Function {
    Function { number, name: name.into(), text: String::new(), idempotent: false, arguments, result }
}

fn data(number: u16, name: &str, ty: Type) -> DataItem {
    DataItem { number, kind: DataKind::Data, field: Field::new(name, ty) }
}

fn interface(functions: Vec<Function>, data: Vec<DataItem>) -> Description {
    Description { name: "Odd".into(), class: "odd".into(), text: String::new(), functions, data }
}

fn of_type(ty: Type) -> Description {
    interface(Vec::new(), vec![data(1, "value", ty)])
}

#[test]
fn what_no_language_has_is_refused_with_its_place() {
    let field = |name: &str| Field::new(name, Type::U8);
    let nested = (0..DEPTH_MAX).fold(Type::U8, |inner, _| Type::option(inner));
    let mut renamed = of_type(Type::U8);
    renamed.name = " ".into();
    let mut classless = of_type(Type::U8);
    classless.class = "a\nb".into();
    let named_part = Members::One(Box::new(field("inside")));
    let variant = |name: &str| Named::new(name, Members::None);
    let choice = |variants| Type::Enum { name: "Choice".into(), text: String::new(), variants };
    for (description, says) in [
        (renamed, "the interface: a name is empty"),
        (classless, "the class: a name with control characters"),
        (
            interface(vec![function(15, "go", vec![], Type::Unit)], vec![]),
            "go: number 15; those of functions are 16 to",
        ),
        (
            interface(vec![function(16, "go", vec![], Type::Unit), function(16, "stop", vec![], Type::Unit)], vec![]),
            "functions: number 16 stands behind 16; an interface has them in order",
        ),
        (interface(vec![function(16, "go", vec![], Type::Unit)], vec![data(1, "go", Type::U8)]), "`go` is there twice"),
        (interface(vec![], vec![data(16_385, "go", Type::U8)]), "go: number 16385; those of data are 0 to 16384"),
        (interface(vec![function(16, "", vec![], Type::Unit)], vec![]), "a function: a name is empty"),
        (
            interface(vec![function(16, "go", vec![field("a"), field("a")], Type::Unit)], vec![]),
            "go: `a` is there twice",
        ),
        (of_type(structure("A", vec![field("x\u{202e}y")])), "A: a name with control characters"),
        (of_type(structure("A", vec![field("")])), "A: a name is empty"),
        (of_type(structure("A", vec![field(&"x".repeat(NAME_BYTES_MAX + 1))])), "A: a name of 201 bytes; 200 are"),
        (of_type(structure("", vec![])), "value: a name is empty"),
        (of_type(Type::Struct(Named::new("A", named_part))), "A: one of its parts has a name, `inside`, where"),
        (of_type(choice(vec![variant("A"), variant("A")])), "Choice: `A` is there twice"),
        (of_type(nested), "value: types nested more than 64 deep"),
        (
            of_type(structure("A", vec![Field::new("x", Type::U8).said("", "m\n")])),
            "A.x, its unit: a name with control",
        ),
    ] {
        let told = Blueprint::of(&description).map_or_else(|error| error.to_string(), |_| "accepted".into());
        assert!(told.contains(says), "{told}\nexpected: {says}");
    }
}

#[test]
fn what_one_language_lacks_is_refused_there_alone() {
    let no_variants = Type::Enum { name: "Never".into(), text: String::new(), variants: Vec::new() };
    let one_part = Members::Tuple(vec![Field::new("", Type::U8)]);
    let named_data = |name: &str| interface(vec![], vec![data(1, name, Type::U8)]);
    let called = |name: &str| interface(vec![function(16, name, vec![], Type::Unit)], vec![]);
    let begun = [function(16, "go", vec![], Type::Unit), function(17, "begin_go", vec![], Type::Unit)];
    let upper = vec![data(1, "pose", Type::U8), data(2, "Pose", Type::U8)];
    let nine = (0..9).map(|at| Field::new(format!("a{at}"), Type::U8)).collect();
    let mut spaced = of_type(Type::U8);
    spaced.name = "Big Motor".into();
    let huge = |length| Type::Array(length, Box::new(Type::F64));
    for (description, says) in [
        (of_type(Type::Array(33, Box::new(Type::U8))), ["serde has those of at most 32", "", ""]),
        (of_type(huge(u32::MAX)), ["at most 32", "", "value: C cannot have a value of 34359738360 bytes"]),
        (of_type((0..4).fold(Type::U8, |inner, _| Type::Array(9999, Box::new(inner)))), ["at most 32", "", "C cannot"]),
        (of_type(Type::Map(Box::new(Type::F64), Box::new(Type::U8))), ["keys with fractions in a map", "", ""]),
        (of_type(Type::Tuple(vec![Type::U8; 9])), ["a tuple of 9 in what travels", "", ""]),
        (of_type(Type::Tuple(vec![])), ["a tuple of 0 in what travels", "", ""]),
        (of_type(Type::Struct(Named::new("One", one_part))), ["several parts that are one", "", ""]),
        (of_type(structure("Empty", vec![])), ["", "named fields of which there are none", ""]),
        (of_type(no_variants), ["", "", "Never: C cannot have an enum without variants"]),
        (interface(vec![], vec![data(0, "zero", Type::U8)]), ["number 0; those of data in Rust are", "", ""]),
        (called("new"), ["`new`: each proxy has a function of this name", "", ""]),
        (called("self"), ["the name `self`", "", ""]),
        (called("größe"), ["the name `größe`", "", ""]),
        (named_data("two words"), ["the name `two words`", "", ""]),
        (interface(begun.into(), vec![]), ["`begin_go`: each proxy has", "", ""]),
        (interface(vec![], upper), ["two constants called POSE", "", ""]),
        (interface(vec![function(16, "go", nine, Type::Unit)], vec![]), ["more than eight arguments", "", ""]),
        (spaced, ["a trait called `Big Motor`", "", ""]),
    ] {
        for (lang, says) in LANGUAGES.into_iter().zip(says) {
            match generated(&description, lang) {
                Ok(code) => assert!(says.is_empty(), "expected {says}: {code}"),
                Err(error) => {
                    let told = error.to_string();
                    assert!(!says.is_empty() && told.contains(says), "{told}\nexpected: {says}");
                }
            }
        }
    }
}

#[test]
fn thousands_of_one_name_have_numbers() {
    let one = |at: u16| Field::new(format!("f{at}"), structure("Same", vec![Field::new(format!("x{at}"), Type::U8)]));
    let description = of_type(structure("All", (0..5000).map(one).collect()));
    let last = ["pub struct Same5000 {", "class Same5000:", "} odd_same_5000;"];
    for (lang, last) in LANGUAGES.into_iter().zip(last) {
        assert!(generated(&description, lang).unwrap().contains(last), "{last}");
    }
}

/// Ends comments, literals and lines of each language, and goes on with what none compiles.
const TEXT: &str = "*/ \"\"\" ??/\n#error FORGED\n'''\\\" compile_error!(\"FORGED\"); raise FORGED \u{202e}\u{2028}\\\
    \r\n#error FORGED \\ ```\n\
    compile_error!(\"FORGED_behind_a_fence_in_a_word_that_is_so_long_that_it_has_a_line_of_its_own_in_all_of_them\")\n\
    ~~~ <script>FORGED</script> \
    the_next_is_behind_a_word_that_is_so_long_that_it_has_a_line_of_its_own_in_all_of_them_and_more >>> FORGED()";
/// The same without what no name may have.
const NAME: &str = "*/ \"\"\" ??/ FORGED'''\\\" compile_error!(FORGED); raise FORGED */ \\";

/// Texts, units and names of all places.
fn all_hostile() -> Description {
    let said = |name: &str, ty: Type| Field::new(name, ty).said(TEXT, NAME);
    let least = |field: Field| field.bounded(Some(vec![9, b'"', b'*', b'/', b'"', b'"', b'"', 10, b'\\', b'x']), None);
    let words = vec![Named::new(NAME, Members::None).said(TEXT), Named::new("Self", Members::None)];
    let carrying = vec![
        Named::new(NAME, Members::One(Box::new(said("", Type::U8)))).said(TEXT),
        Named::new("two", Members::Tuple(vec![said("", Type::U8), said("", Type::Bytes)])).said(TEXT),
        Named::new("class", Members::Fields(vec![said(NAME, Type::U8)])).said(TEXT),
        Named::new("Class", Members::Fields(vec![said("x", Type::U8)])),
    ];
    let choice = |name: &str, variants| Type::Enum { name: name.into(), text: TEXT.into(), variants };
    let fields =
        vec![said(NAME, Type::U8), said("def", Type::Char), least(said("self", Type::Text)), said("int", Type::I8)];
    let inside = vec![
        said("words", choice(&format!("words {NAME}"), words)),
        said("choice", choice("Some", carrying)),
        said("inner", Type::Struct(Named::new(NAME, Members::Fields(fields)).said(TEXT))),
        said("one", Type::Struct(Named::new("String", Members::One(Box::new(said("", Type::F32)))).said(TEXT))),
        said("write", Type::Struct(Named::new("inner_write", Members::None).said(TEXT))),
    ];
    let all = Type::Struct(Named::new("list", Members::Fields(inside)).said(TEXT));
    let mut import = function(16, "import", vec![said("from", Type::F64), said("fn", all.clone())], Type::option(all));
    import.text = TEXT.into();
    let mut item = data(1, "raise", Type::Map(Box::new(Type::Text), Box::new(Type::F32)));
    item.field = item.field.said(TEXT, NAME);
    let mut description = interface(vec![import], vec![item]);
    description.text = TEXT.into();
    description.class = NAME.into();
    description
}

/// A program's exit with this text as its input.
fn accepts(program: &str, arguments: &[&str], text: &str) {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut running = command.spawn().unwrap();
    let mut input = running.stdin.take().unwrap();
    let text = text.to_owned();
    let writer = std::thread::spawn(move || std::io::Write::write_all(&mut input, text.as_bytes()));
    let said = running.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(said.status.success(), "{program}: {}", String::from_utf8_lossy(&said.stderr));
}

#[test]
fn texts_and_names_end_no_comment_and_no_literal() {
    let description = all_hostile();
    let code = LANGUAGES.map(|lang| generated(&description, lang).unwrap());
    for code in &code {
        assert!(code.contains("FORGED"), "the texts are in it");
        assert!(!code.contains(|c| c != '\n' && rohrpost::output::plain::is_obeyed(c)), "{code}");
    }
    let [rust, python, c] = code;
    for line in rust.lines().filter(|line| line.contains("compile_error!")) {
        let literal = ["#[schema(", "#[serde(rename = \"", "#[rohrpost::interface(class = \""];
        let place = line.trim_start();
        assert!(place.starts_with("//") || literal.iter().any(|it| place.contains(it)), "{line}");
    }
    assert!(
        !rust.lines().any(|line| line.contains("///") && ["```", "~~~", "<script"].iter().any(|it| line.contains(it)))
    );
    assert!(!python.lines().any(|line| line.trim_start().starts_with(">>>")), "no line is run by doctest");
    accepts("rustfmt", &["--edition", "2024", "--emit", "stdout"], &rust);
    let classes = python.lines().filter(|line| line.starts_with("class ")).map(|line| line.split(['(', ':']).next());
    let classes: Vec<_> = classes.collect();
    assert_eq!(classes.iter().collect::<std::collections::BTreeSet<_>>().len(), classes.len(), "{classes:?}");
    let tree = "import ast, sys\nfor it in ast.walk(ast.parse(sys.stdin.read())):\n    \
                assert not isinstance(it, ast.Name) or it.id != 'FORGED'\n";
    accepts("python3", &["-c", tree], &python);
    accepts("gcc", &["-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c", "-"], &c);
    accepts("g++", &["-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++", "-"], &c);
}

#[test]
fn generated_functions_hide_none_that_each_module_in_python_has() {
    let source = include_str!("../../../../../clients/python/src/rohrpost/interface.py");
    let class = source.split("\nclass Module:\n").nth(1).unwrap().split("\n\n\ndef ").next().unwrap();
    let functions = class.lines().filter_map(|line| line.strip_prefix("    def ")?.split('(').next());
    let public: Vec<&str> = functions.filter(|name| !name.starts_with('_')).collect();
    assert!(public.contains(&"publish") && public.len() > 8, "{public:?}");
    for name in public {
        assert!(OF_MODULES.contains(&format!(" {name} ")), "`{name}` of rp.Module is missing in OF_MODULES");
    }
}
