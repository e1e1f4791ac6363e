//! Types of C as others use them, and functions that write and read them as postcard.

use super::super::blueprint::Plain;
use super::super::texts::c_comment;
use rohrpost::schema::Type;
use std::fmt::Write;

/// A type of C.
#[derive(Clone)]
pub(super) struct CType {
    pub(super) name: String,
    /// The word in names of functions that take it by value; none: they take it by pointer.
    word: Option<&'static str>,
    /// About how many bytes one has in memory.
    pub(super) size: u64,
    /// Whether its values take bytes on the wire.
    pub(super) takes_bytes: bool,
}

impl CType {
    /// A statement that writes a value.
    pub(super) fn write(&self, place: &str) -> String {
        match self.word {
            Some(word) => format!("rp_pack_{word}(to, {place});"),
            None => format!("{}_write(to, {});", self.name, address(place)),
        }
    }

    /// A statement that reads a value.
    pub(super) fn read(&self, place: &str) -> String {
        match self.word {
            Some(word) => format!("{place} = rp_unpack_{word}(from);"),
            None => format!("{}_read(from, {});", self.name, address(place)),
        }
    }

    /// One that has functions by pointer.
    pub(super) fn structured(name: String, size: u64, takes_bytes: bool) -> Self {
        Self { name, word: None, size, takes_bytes }
    }

    /// One that `postcard.h` reads and writes.
    pub(super) fn plain(plain: &Plain) -> Self {
        let word = if plain.ty == Type::Unit { "nothing" } else { plain.word };
        Self { name: plain.c.into(), word: Some(word), size: plain.c_bytes, takes_bytes: plain.ty != Type::Unit }
    }

    /// As other names have it in them.
    pub(super) fn short<'a>(&'a self, prefix: &str) -> &'a str {
        self.word.unwrap_or_else(|| self.name.strip_prefix(prefix).unwrap_or(&self.name))
    }
}

fn address(place: &str) -> String {
    place.strip_prefix('*').map_or_else(|| format!("&{place}"), str::to_owned)
}

/// One member of a struct: what it is called, its type, and what is said of it.
pub(super) struct Member {
    pub(super) name: String,
    pub(super) ty: CType,
    pub(super) text: String,
}

/// A variant: its constant, and what it carries, as which member of the union.
pub(super) struct Carried {
    pub(super) constant: String,
    pub(super) text: String,
    pub(super) member: Option<(String, CType)>,
}

/// A struct, with its functions.
pub(super) fn structure(name: &str, text: &str, members: &[Member], code: &mut String) {
    let (mut fields, mut writes, mut reads) = (String::new(), String::new(), String::new());
    for Member { name, ty, text } in members {
        fields += &c_comment("    ", text);
        fields += &format!("    {} {name};\n", ty.name);
        writes += &format!("    {}\n", ty.write(&format!("value->{name}")));
        reads += &format!("    {}\n", ty.read(&format!("value->{name}")));
    }
    if members.is_empty() {
        fields = "    rp_nothing nothing; /* takes no bytes */\n".into();
        writes = "    rp_pack_nothing(to, value->nothing);\n".into();
        reads = "    value->nothing = rp_unpack_nothing(from);\n".into();
    }
    put(code, format_args!("{}typedef struct {name} {{\n{fields}}} {name};\n\n", c_comment("", text)));
    functions(name, &writes, &reads, code);
}

/// A value or none.
pub(super) fn option(name: &str, some: &CType, code: &mut String) {
    put(code, format_args!("typedef struct {name} {{\n    bool is_some;\n    {} some;\n}} {name};\n\n", some.name));
    let writes = format!(
        "    rp_pack_bool(to, value->is_some);\n    if (value->is_some) {{\n        {}\n    }}\n",
        some.write("value->some")
    );
    // All of it has values, so that none is read that was never set.
    let reads = format!(
        "    memset(value, 0, sizeof *value);\n    value->is_some = rp_unpack_bool(from);\n    if (value->is_some) \
         {{\n        {}\n    }}\n",
        some.read("value->some")
    );
    functions(name, &writes, &reads, code);
}

/// Any number of one type, elsewhere.
pub(super) fn list(name: &str, element: &CType, code: &mut String) {
    let inner = &element.name;
    put(code, format_args!("typedef struct {name} {{\n    const {inner} *items;\n    size_t count;\n}} {name};\n\n"));
    let writes = format!(
        "    size_t at;\n    rp_pack_u64(to, value->count);\n    for (at = 0; at < value->count; at++) {{\n        \
         {}\n    }}\n",
        element.write("value->items[at]")
    );
    let reads = format!(
        "    size_t at;\n    {inner} *items = ({inner} *)rp_unpack_list(from, &value->count, sizeof *items, {});\n    \
         for (at = 0; at < value->count && from->code == RP_OK; at++) {{\n        {}\n    }}\n    value->items = \
         items;\n",
        element.takes_bytes,
        element.read("items[at]")
    );
    functions(name, &writes, &reads, code);
}

/// A fixed number of one type.
pub(super) fn array(name: &str, length: u32, element: &CType, code: &mut String) {
    let (places, inner) = (length.max(1), &element.name);
    put(code, format_args!("typedef struct {name} {{\n    {inner} items[{places}];\n}} {name};\n\n"));
    if length == 0 {
        let nothing = "    (void)value;\n    rp_pack_nothing(to, 0);\n";
        functions(name, nothing, "    memset(value, 0, sizeof *value);\n    (void)from;\n", code);
        return;
    }
    let each =
        |one: String| format!("    size_t at;\n    for (at = 0; at < {length}; at++) {{\n        {one}\n    }}\n");
    functions(name, &each(element.write("value->items[at]")), &each(element.read("value->items[at]")), code);
}

/// An enum: its number alone, or with what its variant carries.
pub(super) fn choice(name: &str, text: &str, variants: &[Carried], code: &mut String) {
    code.push_str("enum {\n");
    for (number, variant) in variants.iter().enumerate() {
        let comma = if number + 1 == variants.len() { "" } else { "," };
        code.push_str(&c_comment("    ", &variant.text));
        put(code, format_args!("    {} = {number}{comma}\n", variant.constant));
    }
    code.push_str("};\n\n");
    code.push_str(&c_comment("", text));
    let tag = |place: &str| {
        format!(
            "    if ({place} >= {}u) {{\n        rp_pack_fail(to, RP_VARIANT);\n        return;\n    }}\n    \
             rp_pack_u32(to, {place});\n",
            variants.len()
        )
    };
    let carries: Vec<_> = variants.iter().filter_map(|it| Some((&it.constant, it.member.as_ref()?))).collect();
    if carries.is_empty() {
        put(code, format_args!("typedef uint32_t {name};\n\n"));
        let reads = format!("    *value = rp_unpack_tag(from, {});\n", variants.len());
        functions(name, &tag("*value"), &reads, code);
        return;
    }
    let (mut members, mut writes, mut reads) = (String::new(), String::new(), String::new());
    for (constant, (member, ty)) in carries {
        members += &format!("        {} {member}; /* {constant} */\n", ty.name);
        let arm = |one: String| format!("    case {constant}:\n        {one}\n        break;\n");
        writes += &arm(ty.write(&format!("value->as.{member}")));
        reads += &arm(ty.read(&format!("value->as.{member}")));
    }
    put(
        code,
        format_args!("typedef struct {name} {{\n    uint32_t tag;\n    union {{\n{members}    }} as;\n}} {name};\n\n"),
    );
    let switch = |arms: String| format!("    switch (value->tag) {{\n{arms}    default:\n        break;\n    }}\n");
    let read_tag =
        format!("    memset(value, 0, sizeof *value);\n    value->tag = rp_unpack_tag(from, {});\n", variants.len());
    let guard = "    if (from->code != RP_OK) {\n        return;\n    }\n";
    functions(name, &(tag("value->tag") + &switch(writes)), &(read_tag + guard + &switch(reads)), code);
}

fn functions(name: &str, writes: &str, reads: &str, code: &mut String) {
    put(
        code,
        format_args!(
            "static inline void {name}_write(rp_packer *to, const {name} *value) {{\n{writes}}}\n\nstatic inline void \
             {name}_read(rp_unpacker *from, {name} *value) {{\n{reads}}}\n\n"
        ),
    );
}

/// Functions for all bytes of a package: of arguments, a result, or data.
pub(super) fn whole(ty: &CType, code: &mut String) {
    whole_as(&ty.name, ty, code);
}

/// The same under another name.
pub(super) fn whole_as(name: &str, ty: &CType, code: &mut String) {
    let inner = &ty.name;
    put(
        code,
        format_args!(
            "/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code {name}_encode(const {inner} *value, uint8_t *bytes, size_t room, size_t *used) {{
    rp_packer packer = {{bytes, room, 0, RP_OK}};
    rp_packer *to = &packer;
    {write}
    *used = packer.used;
    return packer.code;
}}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code {name}_decode({inner} *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {{
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    {read}
    if (unpacker.left != 0) {{
        rp_unpack_fail(from, RP_LONG);
    }}
    return unpacker.code;
}}

",
            write = ty.write("*value"),
            read = ty.read("*value")
        ),
    );
}

/// Writing to a string does not fail.
fn put(code: &mut String, text: std::fmt::Arguments<'_>) {
    code.write_fmt(text).unwrap_or_default();
}
