//! An interface as a header of C, for C11 and C++17: structs, functions that write and read them as postcard, numbers,
//! the hash and the description's bytes. The header includes nothing but the standard's headers; what all interfaces
//! need of postcard (`postcard.h`) stands in each, and counts once.

mod functions;
mod types;

use super::blueprint::{Blueprint, Layout};
use super::names::snake;
use super::refusal::Refusal;
use super::texts::{c_comment, c_literal, in_c_comment, of_field};
use rohrpost::schema::{DataKind, Type};
use types::CTypes;

const POSTCARD: &str = include_str!("postcard.h");

/// The whole header.
pub(super) fn write(blueprint: &Blueprint<'_>) -> Result<String, Refusal> {
    // What `postcard.h` defines begins with `rp_`.
    let prefix = match snake(blueprint.name, "interface") {
        own if own == "rp" || own.starts_with("rp_") => format!("interface_{own}"),
        prefix => prefix,
    };
    let upper = prefix.to_uppercase();
    let mut types = CTypes::new(blueprint, &prefix);
    let mut numbers = String::new();
    for operation in &blueprint.operations {
        let name = snake(&operation.function.name, "function");
        let number = types.constant(&format!("{upper}_FUNCTION_{}", name.to_uppercase()));
        numbers += &c_comment("", &operation.function.text);
        numbers += &format!("#define {number} {}\n", operation.function.number);
        if !operation.arguments.is_empty() {
            let place = operation.function.name.clone();
            let arguments = types.arguments(&format!("{prefix}_{name}_arguments"), &operation.arguments, &place)?;
            functions::whole(&arguments, &mut types.code);
        }
        let result = format!("{prefix}_{name}_result");
        match &operation.result {
            layout if layout.is(&Type::Unit) => {}
            Layout::Result(value, error) => {
                let result = types.result(&result, value, error, &operation.function.name)?;
                functions::whole(&result, &mut types.code);
            }
            layout => types.alias(&result, layout, &operation.function.name)?,
        }
    }
    for published in &blueprint.published {
        let field = published.part.field;
        let name = snake(&field.name, "data");
        let number = types.constant(&format!("{upper}_DATA_{}", name.to_uppercase()));
        numbers += &c_comment("", &of_field(field));
        let kind = match published.kind {
            DataKind::Data => "",
            DataKind::Stream => " /* a stream */",
        };
        numbers += &format!("#define {number} {}{kind}\n", published.number);
        types.alias(&format!("{prefix}_data_{name}"), &published.part.layout, &field.name)?;
    }
    let told = |text: &str| in_c_comment(text);
    let mut code = format!(
        "/* Interface {name} of class {class}.
 *
 * Made by `rohrpost interface generate --lang c`: do not change it here, but where it was written, and make this anew.
 * C11 or C++17. Reading: `…_decode` with memory for elements of lists; texts and bytes stay in the buffer. Writing:
 * `…_encode` into a buffer; its length is told also when there is no room. */
#ifndef ROHRPOST_{upper}_{hash:08X}
#define ROHRPOST_{upper}_{hash:08X}

{POSTCARD}
",
        name = told(blueprint.name),
        class = told(blueprint.class),
        hash = blueprint.hash
    );
    code += &c_comment("", blueprint.text);
    code += &format!("#define {upper}_CLASS {}\n", c_literal(blueprint.class));
    code += &format!(
        "/** Tells this interface from others; callers and servers have the same. For `rohrpost_module_call`. \
         */\n#define {upper}_HASH UINT32_C({:#010x})\n\n/* Numbers of functions and of data. */\n\n{numbers}\n{}\n",
        blueprint.hash, types.code
    );
    code += &description(&prefix, &blueprint.bytes);
    code += "\n#endif\n";
    Ok(code)
}

/// The bytes that a module of this interface answers `describe` with.
fn description(prefix: &str, bytes: &[u8]) -> String {
    let rows = bytes.chunks(20).map(|row| {
        let row: Vec<String> = row.iter().map(|byte| byte.to_string()).collect();
        format!("    {},\n", row.join(", "))
    });
    format!(
        "/** The interface as a module answers `describe` with it: {length} bytes. */\nstatic const uint8_t \
         {prefix}_description[{length}] = {{\n{}}};\n",
        rows.collect::<String>(),
        length = bytes.len()
    )
}
