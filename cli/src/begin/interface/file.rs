//! An interface as a file: what `call --json` prints of it, with the file's format and the interface's hash.
//!
//! Reading is strict. What is not known is refused with its place, as a file that is only half understood would make
//! code of another interface; and the hash must be that of what was read.

use super::blueprint::PLAIN;
use rohrpost::output::plain;
use rohrpost::schema::{
    DataItem, DataKind, Description, Field, Function, Members, Named, SchemaError, TYPES_MAX, Type, Value, WalkError,
    encode,
};
use serde::Serialize;
use serde_json::{Map, Value as Json};
use std::io::Read;
use std::path::Path;

/// Raised when older programs would misunderstand a file.
const FORMAT: u64 = 1;
/// A description has at most 1 MiB; as JSON it is longer.
const BYTES_MAX: u64 = 8 << 20;
/// Values of JSON: a field with all that is said of it has thirteen. As JSON they take a hundred times as much memory
/// as text, so they are counted before.
const PARTS_MAX: usize = 16 * TYPES_MAX;

/// Why a file is no interface.
#[derive(Debug, thiserror::Error)]
pub(super) enum FileError {
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error("more than {} MiB; no interface is so long", BYTES_MAX >> 20)]
    Long,
    #[error("more than {PARTS_MAX} values of JSON; an interface has at most {TYPES_MAX} types, and needs fewer")]
    Parts,
    /// Also what nests deeper than the library reads, 128 brackets.
    #[error("no JSON of an interface: {0}")]
    Json(#[from] serde_json::Error),
    #[error("{}: {problem}", plain::line(.place))]
    Place { place: String, problem: PlaceProblem },
    #[error("the file says hash {said}, and what it describes has {is:#010x}; export it again, change no file by hand")]
    Hash { said: String, is: u32 },
    #[error("no interface: {0}")]
    Schema(#[from] SchemaError),
    #[error("this interface nests deeper than a file can: {0}")]
    Deep(serde_json::Error),
}

#[derive(Debug, thiserror::Error)]
pub(super) enum PlaceProblem {
    #[error("expected {expected}, got `{}`", plain::line(.got))]
    Expected { expected: &'static str, got: String },
    #[error("not given; expected {0}")]
    Missing(&'static str),
    #[error("nothing of this name belongs here")]
    Unknown,
    #[error("format {0}, this program reads {FORMAT}; use programs of the same version of Rohrpost")]
    Format(u64),
    #[error("{0}")]
    Bound(WalkError),
}

#[derive(Serialize)]
struct InterfaceFile<'a> {
    format: u64,
    hash: String,
    #[serde(flatten)]
    description: &'a Description,
}

/// The file of an interface.
pub(super) fn write(description: &Description) -> Result<String, FileError> {
    let hash = format!("{:#010x}", description.hash());
    let text = serde_json::to_string_pretty(&InterfaceFile { format: FORMAT, hash, description })?;
    // What cannot be read back is written for nobody.
    match read(&text) {
        Err(FileError::Json(error)) => Err(FileError::Deep(error)),
        read => read.map(|_| text),
    }
}

pub(super) fn load(file: &Path) -> Result<Description, FileError> {
    let mut text = String::new();
    std::fs::File::open(file)?.take(BYTES_MAX + 1).read_to_string(&mut text)?;
    if text.len() as u64 > BYTES_MAX {
        return Err(FileError::Long);
    }
    read(&text)
}

/// Reads what [`write`] wrote.
pub(super) fn read(text: &str) -> Result<Description, FileError> {
    if parts(text) > PARTS_MAX {
        return Err(FileError::Parts);
    }
    let json: Json = serde_json::from_str(text)?;
    let file = FilePlace { above: None, json: &json };
    let keys = ["format", "hash", "name", "class", "text", "functions", "data"];
    let top = file.object(&keys)?;
    let format = top.need("format", "the number of the format")?;
    match format.json.as_u64() {
        Some(FORMAT) => {}
        Some(other) => return Err(format.wrong(PlaceProblem::Format(other))),
        None => return Err(format.expected("the number of the format")),
    }
    let said = top.need("hash", "the hash")?.text()?;
    let description = Description {
        name: top.need("name", "a name")?.text()?,
        class: top.need("class", "a class")?.text()?,
        text: top.text_or_none("text")?,
        functions: top.need("functions", "a list of functions")?.each(|place| place.function())?,
        data: top.need("data", "a list of data")?.each(|place| place.data_item())?,
    };
    // The bounds of all descriptions: how many types, and how deep.
    let description = Description::from_bytes(&description.to_bytes())?;
    let is = description.hash();
    let number = said.strip_prefix("0x").and_then(|digits| u32::from_str_radix(digits, 16).ok());
    if number != Some(is) {
        return Err(FileError::Hash { said: plain::line(&said).into_owned(), is });
    }
    Ok(description)
}

/// Values of JSON in a text, less the outermost.
fn parts(text: &str) -> usize {
    let (mut parts, mut in_text, mut is_escaped) = (0, false, false);
    for byte in text.bytes() {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = in_text,
            b'"' => in_text = !in_text,
            b',' | b'[' | b'{' if !in_text => parts += 1,
            _ => {}
        }
    }
    parts
}

/// A value in the file, and the way to it: from what is above it, by a step. A text is made of it for an error alone.
struct FilePlace<'p> {
    above: Option<(&'p FilePlace<'p>, FileStep<'p>)>,
    json: &'p Json,
}

#[derive(Clone, Copy)]
enum FileStep<'p> {
    Key(&'p str),
    Element(usize),
}

/// An object in the file, of which all keys are known.
struct Object<'p> {
    place: &'p FilePlace<'p>,
    entries: &'p Map<String, Json>,
}

impl<'p> Object<'p> {
    fn get(&self, key: &'p str) -> Option<FilePlace<'p>> {
        self.entries.get(key).map(|json| self.place.key(key, json))
    }

    fn need(&self, key: &'p str, expected: &'static str) -> Result<FilePlace<'p>, FileError> {
        self.get(key).ok_or_else(|| self.place.key(key, &Json::Null).wrong(PlaceProblem::Missing(expected)))
    }

    fn text_or_none(&self, key: &'p str) -> Result<String, FileError> {
        self.get(key).map_or(Ok(String::new()), |place| place.text())
    }
}

impl FilePlace<'_> {
    fn key<'s>(&'s self, key: &'s str, json: &'s Json) -> FilePlace<'s> {
        FilePlace { above: Some((self, FileStep::Key(key))), json }
    }

    fn element<'s>(&'s self, at: usize, json: &'s Json) -> FilePlace<'s> {
        FilePlace { above: Some((self, FileStep::Element(at))), json }
    }

    fn path(&self) -> String {
        let Some((above, step)) = &self.above else { return String::new() };
        let path = above.path();
        match step {
            FileStep::Key(key) if path.is_empty() => (*key).to_owned(),
            FileStep::Key(key) => format!("{path}.{key}"),
            FileStep::Element(at) => format!("{path}[{at}]"),
        }
    }

    fn wrong(&self, problem: PlaceProblem) -> FileError {
        let path = self.path();
        FileError::Place { place: if path.is_empty() { "the whole".into() } else { path }, problem }
    }

    fn expected(&self, expected: &'static str) -> FileError {
        let mut got = self.json.to_string();
        if let Some((end, _)) = got.char_indices().nth(40) {
            got.truncate(end);
            got.push('…');
        }
        self.wrong(PlaceProblem::Expected { expected, got })
    }

    fn object(&self, keys: &[&str]) -> Result<Object<'_>, FileError> {
        let entries = self.json.as_object().ok_or_else(|| self.expected("an object"))?;
        match entries.iter().find(|(key, _)| !keys.contains(&key.as_str())) {
            Some((key, json)) => Err(self.key(key, json).wrong(PlaceProblem::Unknown)),
            None => Ok(Object { place: self, entries }),
        }
    }

    fn text(&self) -> Result<String, FileError> {
        self.json.as_str().map(str::to_owned).ok_or_else(|| self.expected("a text"))
    }

    fn number(&self) -> Result<u16, FileError> {
        let number = self.json.as_u64().and_then(|number| u16::try_from(number).ok());
        number.ok_or_else(|| self.expected("a number from 0 to 65535"))
    }

    fn list(&self) -> Result<&[Json], FileError> {
        self.json.as_array().map(Vec::as_slice).ok_or_else(|| self.expected("a list"))
    }

    fn each<T>(&self, read: impl Fn(&FilePlace<'_>) -> Result<T, FileError>) -> Result<Vec<T>, FileError> {
        self.list()?.iter().enumerate().map(|(at, json)| read(&self.element(at, json))).collect()
    }

    fn function(&self) -> Result<Function, FileError> {
        let object = self.object(&["number", "name", "text", "idempotent", "arguments", "result"])?;
        let idempotent = object.need("idempotent", "true or false")?;
        Ok(Function {
            number: object.need("number", "a number")?.number()?,
            name: object.need("name", "a name")?.text()?,
            text: object.text_or_none("text")?,
            idempotent: idempotent.json.as_bool().ok_or_else(|| idempotent.expected("true or false"))?,
            arguments: object.need("arguments", "a list of arguments")?.each(|place| place.field())?,
            result: object.need("result", "a type")?.ty()?,
        })
    }

    fn data_item(&self) -> Result<DataItem, FileError> {
        let object = self.object(&["number", "kind", "name", "text", "unit", "type", "min", "max"])?;
        let kind = object.need("kind", "`data` or `stream`")?;
        Ok(DataItem {
            number: object.need("number", "a number")?.number()?,
            kind: match kind.json.as_str() {
                Some("data") => DataKind::Data,
                Some("stream") => DataKind::Stream,
                _ => return Err(kind.expected("`data` or `stream`")),
            },
            field: field_of(&object)?,
        })
    }

    fn field(&self) -> Result<Field, FileError> {
        field_of(&self.object(&["name", "text", "unit", "type", "min", "max"])?)
    }

    fn ty(&self) -> Result<Type, FileError> {
        const TYPE: &str = "a type, such as `f64` or {\"list\": \"f64\"}";
        if let Some(word) = self.json.as_str() {
            let plain = PLAIN.iter().find(|plain| plain.word == word);
            return plain.map(|plain| plain.ty.clone()).ok_or_else(|| self.expected(TYPE));
        }
        let (tag, json) = match self.json.as_object().map(|entries| (entries.len(), entries.iter().next())) {
            Some((1, Some(only))) => only,
            _ => return Err(self.expected(TYPE)),
        };
        let inner = self.key(tag, json);
        let pair = || match inner.list()? {
            [first, second] => Ok((inner.element(0, first), inner.element(1, second))),
            _ => Err(inner.expected("a list of two")),
        };
        Ok(match tag.as_str() {
            "option" => Type::option(inner.ty()?),
            "list" => Type::list(inner.ty()?),
            "array" => {
                let (length, element) = pair()?;
                let number = length.json.as_u64().and_then(|number| u32::try_from(number).ok());
                let number = number.ok_or_else(|| length.expected("a number of elements"))?;
                Type::Array(number, Box::new(element.ty()?))
            }
            "map" => {
                let (key, value) = pair()?;
                Type::Map(Box::new(key.ty()?), Box::new(value.ty()?))
            }
            "tuple" => Type::Tuple(inner.each(|place| place.ty())?),
            "struct" => Type::Struct(inner.named()?),
            "enum" => {
                let object = inner.object(&["name", "text", "variants"])?;
                Type::Enum {
                    name: object.need("name", "a name")?.text()?,
                    text: object.text_or_none("text")?,
                    variants: object.need("variants", "a list of variants")?.each(|place| place.named())?,
                }
            }
            _ => return Err(self.expected(TYPE)),
        })
    }

    fn named(&self) -> Result<Named, FileError> {
        const MEMBERS: &str = "`none`, or an object with `one`, `tuple` or `fields`";
        let object = self.object(&["name", "text", "members"])?;
        let members = object.need("members", MEMBERS)?;
        let entry = members.json.as_object().filter(|entries| entries.len() == 1).and_then(|it| it.iter().next());
        let inner = entry.map(|(tag, json)| (tag.as_str(), members.key(tag, json)));
        let inside = match inner {
            None if *members.json == "none" => Members::None,
            Some(("one", field)) => Members::One(Box::new(field.field()?)),
            Some(("tuple", fields)) => Members::Tuple(fields.each(|place| place.field())?),
            Some(("fields", fields)) => Members::Fields(fields.each(|place| place.field())?),
            _ => return Err(members.expected(MEMBERS)),
        };
        let text = object.text_or_none("text")?;
        Ok(Named::new(object.need("name", "a name")?.text()?, inside).said(text))
    }
}

fn field_of(object: &Object<'_>) -> Result<Field, FileError> {
    let ty = object.need("type", "a type")?.ty()?;
    let bound = |key| {
        let Some(place) = object.get(key) else { return Ok(None) };
        let value: Value = serde_json::from_value(place.json.clone())?;
        encode(&ty, &value).map(Some).map_err(|error| place.wrong(PlaceProblem::Bound(error)))
    };
    let (least, most) = (bound("min")?, bound("max")?);
    let field = Field::new(object.text_or_none("name")?, ty);
    Ok(field.said(object.text_or_none("text")?, object.text_or_none("unit")?).bounded(least, most))
}
