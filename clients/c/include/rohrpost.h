// Rohrpost for C. Made of the library's sources by `UPDATE_GOLDEN=1 cargo test -p rohrpost-c --test header`.
//
// Each call returns a `rohrpost_code`: 0 when it is done, above 0 when there is nothing to hand out, below 0 when it
// failed; `rohrpost_last_error` says why. A handle belongs to the thread that opened it. The book's page on C has more.

#ifndef ROHRPOST_H
#define ROHRPOST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The name of a mailbox by its parts: system, class, instance, local id.
#define ROHRPOST_NAME(system, class_id, instance, local) \
    ((uint32_t)(system) << 24 | (uint32_t)(class_id) << 16 | (uint32_t)(instance) << 8 | (uint32_t)(local))

// Types of packages: command `n`, the reply to it, data `n`.
#define ROHRPOST_COMMAND(n) ((int16_t)(n))
#define ROHRPOST_REPLY(n) ((int16_t)-(n))
#define ROHRPOST_DATA(n) ((int16_t)(-16384 - (n)))

// A mailbox as it is without a shape.
#define ROHRPOST_MAILBOX_DEFAULT {32, 1024, 0, 1, 0}
// A stream as it is without a shape.
#define ROHRPOST_STREAM_DEFAULT {1024, 64, 8, 0}

// Entries of a table.
#define ROHRPOST_COUNT(table) (sizeof(table) / sizeof((table)[0]))

// Types that are their kind alone.
#define ROHRPOST_PLAIN(kind) {kind, 0, NULL, NULL, NULL}
#define ROHRPOST_UNIT ROHRPOST_PLAIN(ROHRPOST_KIND_UNIT)
#define ROHRPOST_BOOL ROHRPOST_PLAIN(ROHRPOST_KIND_BOOL)
#define ROHRPOST_U8 ROHRPOST_PLAIN(ROHRPOST_KIND_U8)
#define ROHRPOST_U16 ROHRPOST_PLAIN(ROHRPOST_KIND_U16)
#define ROHRPOST_U32 ROHRPOST_PLAIN(ROHRPOST_KIND_U32)
#define ROHRPOST_U64 ROHRPOST_PLAIN(ROHRPOST_KIND_U64)
#define ROHRPOST_U128 ROHRPOST_PLAIN(ROHRPOST_KIND_U128)
#define ROHRPOST_I8 ROHRPOST_PLAIN(ROHRPOST_KIND_I8)
#define ROHRPOST_I16 ROHRPOST_PLAIN(ROHRPOST_KIND_I16)
#define ROHRPOST_I32 ROHRPOST_PLAIN(ROHRPOST_KIND_I32)
#define ROHRPOST_I64 ROHRPOST_PLAIN(ROHRPOST_KIND_I64)
#define ROHRPOST_I128 ROHRPOST_PLAIN(ROHRPOST_KIND_I128)
#define ROHRPOST_F32 ROHRPOST_PLAIN(ROHRPOST_KIND_F32)
#define ROHRPOST_F64 ROHRPOST_PLAIN(ROHRPOST_KIND_F64)
#define ROHRPOST_CHAR ROHRPOST_PLAIN(ROHRPOST_KIND_CHAR)
#define ROHRPOST_TEXT ROHRPOST_PLAIN(ROHRPOST_KIND_TEXT)
#define ROHRPOST_BYTES ROHRPOST_PLAIN(ROHRPOST_KIND_BYTES)

// Types of others: `types` is a table of `rohrpost_type`, of one entry but for maps (key, value) and tuples.
#define ROHRPOST_OPTION(types) {ROHRPOST_KIND_OPTION, 1, types, NULL, NULL}
#define ROHRPOST_LIST(types) {ROHRPOST_KIND_LIST, 1, types, NULL, NULL}
#define ROHRPOST_ARRAY(length, types) {ROHRPOST_KIND_ARRAY, length, types, NULL, NULL}
#define ROHRPOST_MAP(types) {ROHRPOST_KIND_MAP, 2, types, NULL, NULL}
#define ROHRPOST_TUPLE(types) {ROHRPOST_KIND_TUPLE, ROHRPOST_COUNT(types), types, NULL, NULL}
// A struct: a `rohrpost_named`.
#define ROHRPOST_STRUCT(named) {ROHRPOST_KIND_STRUCT, 1, NULL, &(named), NULL}
// An enum: a `rohrpost_named` with its name and text, and a table of its variants.
#define ROHRPOST_ENUM(named, variants) {ROHRPOST_KIND_ENUM, ROHRPOST_COUNT(variants), NULL, &(named), variants}

// A field, an argument, or what data are; and the same with bounds, as a user would type them.
#define ROHRPOST_FIELD(name, type, unit, text) {name, type, unit, text, NULL, NULL}
#define ROHRPOST_BOUNDED(name, type, unit, text, least, most) {name, type, unit, text, least, most}
// A struct, or a variant with named fields, by a table of them.
#define ROHRPOST_NAMED(name, text, fields) {name, text, ROHRPOST_MEMBERS_FIELDS, fields, ROHRPOST_COUNT(fields)}
// A variant with nothing in it, or with one field without a name, which is a table of one.
#define ROHRPOST_VARIANT(name, text) {name, text, ROHRPOST_MEMBERS_NONE, NULL, 0}
#define ROHRPOST_VARIANT_OF(name, text, field) {name, text, ROHRPOST_MEMBERS_ONE, field, 1}

// A function, by a table of its arguments; one without arguments.
#define ROHRPOST_FUNCTION(number, name, arguments, result, text) \
    {number, name, text, false, arguments, ROHRPOST_COUNT(arguments), result}
#define ROHRPOST_ASKED(number, name, result, text) {number, name, text, false, NULL, 0, result}
// A kind of data, and a stream.
#define ROHRPOST_PUBLISHED(number, name, type, unit, text) \
    {number, false, {name, type, unit, text, NULL, NULL}}
#define ROHRPOST_STREAMED(number, name, type, unit, text) {number, true, {name, type, unit, text, NULL, NULL}}
// A parameter, with the value that it has if the configuration says none, and bounds.
#define ROHRPOST_PARAMETER(name, type, unit, text, value, least, most) \
    {{name, type, unit, text, least, most}, value}

// A table and its length; none.
#define ROHRPOST_ALL(table) table, ROHRPOST_COUNT(table)
#define ROHRPOST_NONE NULL, 0
// An interface; `functions` and `data` are `ROHRPOST_ALL(table)` or `ROHRPOST_NONE`.
#define ROHRPOST_INTERFACE(name, class_name, text, functions, data) {name, class_name, text, functions, data, NULL, 0}
// The same by the bytes of its description, a table of `uint8_t`.
#define ROHRPOST_DESCRIBED(bytes) {NULL, NULL, NULL, ROHRPOST_NONE, ROHRPOST_NONE, ROHRPOST_ALL(bytes)}


// The body's first 8 bytes are the system time of its making, nanoseconds since 1970, little-endian.
#define ROHRPOST_OPTION_STAMPED 2

// The body is a fault, not the answer that was asked for.
#define ROHRPOST_OPTION_ERROR 4

// Its receiver died while it had this package; it is handed out a second and last time.
#define ROHRPOST_OPTION_REDELIVERED 8

// Only the newest of one sender, receiver, type and id counts.
#define ROHRPOST_OPTION_NEWEST 16

// Most mailboxes and streams that one call waits for.
#define ROHRPOST_SOURCES_MAX 64

// Something can be read, or will never be again.
#define ROHRPOST_READ 1

// There is room to write.
#define ROHRPOST_WRITE 2

// How a call ended: 0 when it is done, above 0 when there is nothing to hand out, below 0 when it failed.
enum rohrpost_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  ROHRPOST_OK = 0,
  // Nothing is there (yet), or the time has passed.
  ROHRPOST_NOTHING = 1,
  // A reader of a stream has lost records; it goes on with the oldest that is still there.
  ROHRPOST_LOST = 2,
  // A pointer that must not be null is.
  ROHRPOST_NULL_POINTER = -1,
  // An argument that cannot be: a reserved name, an impossible shape, a text that is not UTF-8.
  ROHRPOST_VALUE = -2,
  // A buffer is too small.
  ROHRPOST_SMALL_BUFFER = -3,
  // No handle of this kind.
  ROHRPOST_HANDLE = -4,
  // The handle was closed.
  ROHRPOST_CLOSED = -5,
  // The handle belongs to another thread.
  ROHRPOST_THREAD = -6,
  // The handle was opened before this process was forked.
  ROHRPOST_FORKED = -7,
  // Something of this handle is in hand (a loan, a package, a record), or another call of this thread goes on.
  ROHRPOST_BUSY = -8,
  // A mistake in Rohrpost.
  ROHRPOST_BUG = -9,
  // The system refused something.
  ROHRPOST_SYSTEM = -10,
  // There is no such node.
  ROHRPOST_NO_NODE = -11,
  // Permission denied.
  ROHRPOST_DENIED = -12,
  // Made by another version of Rohrpost.
  ROHRPOST_OTHER_VERSION = -13,
  // A file in shared memory is damaged, or not Rohrpost's.
  ROHRPOST_DAMAGED = -14,
  // All places are taken.
  ROHRPOST_CROWDED = -15,
  // The configuration cannot be used, or does not have what is asked for.
  ROHRPOST_CONFIGURATION = -16,
  // There is no such mailbox on this node, and no router leads to it.
  ROHRPOST_NO_MAILBOX = -17,
  // The router that leads there does not run.
  ROHRPOST_NO_ROUTER = -18,
  // The mailbox is full.
  ROHRPOST_FULL = -19,
  // More bytes than fit.
  ROHRPOST_TOO_LARGE = -20,
  // Another process owns it.
  ROHRPOST_OWNED = -21,
  // No memory.
  ROHRPOST_MEMORY = -22,
  // No file descriptor left.
  ROHRPOST_DESCRIPTORS = -23,
  // A stamp is too far behind, or of an epoch that has ended.
  ROHRPOST_LATE = -24,
  // Bytes that are not of the type that is read.
  ROHRPOST_MALFORMED = -25,
  // What a module itself calls a failure.
  ROHRPOST_FAILED = -26,
  // Only a function of a module that runs may call this, in its thread.
  ROHRPOST_OUTSIDE = -27,
  // No answer in time: it may have been run, or not.
  ROHRPOST_TIMEOUT = -28,
  // The other module did not run it.
  ROHRPOST_FAULT = -29,
  // There is no such function, data, stream or parameter.
  ROHRPOST_NO_ITEM = -30,
  // The ring of a stream cannot be used, now or at all: its seats are taken, its file is missing or damaged. The
  // last error says which.
  ROHRPOST_RING = -31,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_code rohrpost_code;
#else
typedef int32_t rohrpost_code;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How a module follows data or a stream of another one.
enum rohrpost_follow
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Each value, as data.
  ROHRPOST_FOLLOW_EACH = 0,
  // Of values that wait only the newest, as data.
  ROHRPOST_FOLLOW_NEWEST = 1,
  // Each record of a stream of this node, in place.
  ROHRPOST_FOLLOW_RECORDS = 2,
  // The newest value once in a period, as data.
  ROHRPOST_FOLLOW_PERIOD = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_follow rohrpost_follow;
#else
typedef uint8_t rohrpost_follow;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How important a line of output is.
enum rohrpost_level
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The module cannot do its work.
  ROHRPOST_LEVEL_ERROR = 0,
  // Something is not as it should be.
  ROHRPOST_LEVEL_WARN = 1,
  // What a user wants to know.
  ROHRPOST_LEVEL_INFO = 2,
  // What an author wants to know.
  ROHRPOST_LEVEL_DEBUG = 3,
  // Everything.
  ROHRPOST_LEVEL_TRACE = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_level rohrpost_level;
#else
typedef uint8_t rohrpost_level;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a struct or variant has in it.
enum rohrpost_members
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing.
  ROHRPOST_MEMBERS_NONE = 0,
  // One field without a name.
  ROHRPOST_MEMBERS_ONE = 1,
  // Several without names.
  ROHRPOST_MEMBERS_TUPLE = 2,
  // Fields by their names.
  ROHRPOST_MEMBERS_FIELDS = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_members rohrpost_members;
#else
typedef uint8_t rohrpost_members;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a mailbox does with a package that finds no free slot.
enum rohrpost_overflow
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // It takes the place of the newest of the least important, if it is more important.
  ROHRPOST_OVERFLOW_DISPLACE = 0,
  // It is refused.
  ROHRPOST_OVERFLOW_REJECT = 1,
  // For state: a newer package of the same sender, type and id replaces the older one, full or not.
  ROHRPOST_OVERFLOW_LATEST = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_overflow rohrpost_overflow;
#else
typedef uint8_t rohrpost_overflow;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Kinds of types; the numbers are those of the wire format.
enum rohrpost_kind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing.
  ROHRPOST_KIND_UNIT = 0,
  // True or false.
  ROHRPOST_KIND_BOOL = 1,
  // A whole number from 0, of 8 bits.
  ROHRPOST_KIND_U8 = 2,
  // 16 bits.
  ROHRPOST_KIND_U16 = 3,
  // 32 bits.
  ROHRPOST_KIND_U32 = 4,
  // 64 bits.
  ROHRPOST_KIND_U64 = 5,
  // 128 bits.
  ROHRPOST_KIND_U128 = 6,
  // A whole number with a sign, of 8 bits.
  ROHRPOST_KIND_I8 = 7,
  // 16 bits.
  ROHRPOST_KIND_I16 = 8,
  // 32 bits.
  ROHRPOST_KIND_I32 = 9,
  // 64 bits.
  ROHRPOST_KIND_I64 = 10,
  // 128 bits.
  ROHRPOST_KIND_I128 = 11,
  // A number with a fraction, of 32 bits.
  ROHRPOST_KIND_F32 = 12,
  // 64 bits.
  ROHRPOST_KIND_F64 = 13,
  // One character.
  ROHRPOST_KIND_CHAR = 14,
  // Text.
  ROHRPOST_KIND_TEXT = 15,
  // Bytes.
  ROHRPOST_KIND_BYTES = 16,
  // A value of `types[0]`, or none.
  ROHRPOST_KIND_OPTION = 17,
  // Any number of `types[0]`.
  ROHRPOST_KIND_LIST = 18,
  // `count` of `types[0]`.
  ROHRPOST_KIND_ARRAY = 19,
  // Keys of `types[0]`, and what belongs to each, `types[1]`.
  ROHRPOST_KIND_MAP = 20,
  // `count` values of `types`, one after the other.
  ROHRPOST_KIND_TUPLE = 21,
  // A struct: `named`.
  ROHRPOST_KIND_STRUCT = 22,
  // One of `count` `variants`; its name and text are those of `named`.
  ROHRPOST_KIND_ENUM = 23,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_kind rohrpost_kind;
#else
typedef uint8_t rohrpost_kind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Reads values one behind the other. A value that is not there is 0, and all behind it.
typedef struct rohrpost_decoder {
  // What is not read yet.
  const uint8_t *bytes;
  // How many these are.
  size_t left;
  // A code: how it went until now. Once it is not `ROHRPOST_OK`, nothing more is read.
  int32_t state;
} rohrpost_decoder;

// A struct or a variant: `ROHRPOST_NAMED` writes it.
typedef struct rohrpost_named {
  // A name that others may rely on; it counts in the hash.
  const char *name;
  // What it is; null: not said.
  const char *text;
  // One of `rohrpost_members`.
  uint8_t members;
  // What is in it.
  const struct rohrpost_field *fields;
  // How many.
  size_t field_count;
} rohrpost_named;

// A type: `ROHRPOST_F64` and so on, `ROHRPOST_OPTION`, `ROHRPOST_LIST`, `ROHRPOST_STRUCT` and so on write it.
typedef struct rohrpost_type {
  // One of `rohrpost_kind`.
  uint8_t kind;
  // Elements of an array or a tuple, variants of an enum.
  uint32_t count;
  // Types that it is made of.
  const struct rohrpost_type *types;
  // A struct; of an enum its name and text.
  const struct rohrpost_named *named;
  // Of an enum.
  const struct rohrpost_named *variants;
} rohrpost_type;

// A type in its place: `ROHRPOST_FIELD` writes it.
typedef struct rohrpost_field {
  // Its name; null or empty where it has none.
  const char *name;
  // Its type.
  struct rohrpost_type ty;
  // Unit of its value; null: none.
  const char *unit;
  // What it is for; null: not said.
  const char *text;
  // Least value, as a user would type it; null: not bounded.
  const char *least;
  // Greatest value, likewise.
  const char *most;
} rohrpost_field;

// A function that others call.
typedef struct rohrpost_function {
  // Its number, 16 to 16383.
  uint16_t number;
  // Its name.
  const char *name;
  // What it does; null: not said.
  const char *text;
  // Whether running it twice does no harm.
  bool idempotent;
  // Its arguments, in order.
  const struct rohrpost_field *arguments;
  // How many.
  size_t argument_count;
  // What it returns.
  struct rohrpost_type result;
} rohrpost_function;

// Data or a stream that others read.
typedef struct rohrpost_data {
  // Its number, 1 to 16384.
  uint16_t number;
  // Whether its values are kept as a stream.
  bool is_stream;
  // Its name, type, unit and text.
  struct rohrpost_field field;
} rohrpost_data;

// What a module offers: `ROHRPOST_INTERFACE` writes it.
typedef struct rohrpost_interface {
  // Its name.
  const char *name;
  // Class of the modules that offer it.
  const char *class_name;
  // What it is for; null: not said.
  const char *text;
  // Its functions, by number.
  const struct rohrpost_function *functions;
  // How many.
  size_t function_count;
  // Its data and streams, by number.
  const struct rohrpost_data *data;
  // How many.
  size_t data_count;
  // The description's bytes, in place of all above; null: the tables above.
  const uint8_t *described;
  // How many.
  size_t described_len;
} rohrpost_interface;

// Writes values one behind the other into bytes of the caller's.
typedef struct rohrpost_encoder {
  // Where they go.
  uint8_t *bytes;
  // Bytes that there are.
  size_t room;
  // Bytes that are written.
  size_t len;
  // A code: how it went until now. Once it is not `ROHRPOST_OK`, nothing more is written.
  int32_t state;
} rohrpost_encoder;

// A node that this thread takes part in.
typedef struct rohrpost_node {
  // Which; 0 is none.
  uint64_t id;
} rohrpost_node;

// A way into one mailbox.
typedef struct rohrpost_sender {
  // Which; 0 is none.
  uint64_t id;
} rohrpost_sender;

// What a sender says of a package besides its body.
typedef struct rohrpost_label {
  // Mailbox that answers go to; 0: none.
  uint32_t from;
  // What it is: `ROHRPOST_COMMAND(n)`, `ROHRPOST_REPLY(n)`, `ROHRPOST_DATA(n)`.
  int16_t kind;
  // Tells packages of one type apart.
  uint16_t id;
  // How urgent, 255 most: the id of the sender's class.
  uint8_t priority;
  // Bits `ROHRPOST_OPTION_...`.
  uint8_t options;
} rohrpost_label;

// What a mailbox is asked to be. `ROHRPOST_MAILBOX_DEFAULT` is one.
typedef struct rohrpost_mailbox_shape {
  // Slots, 1 to 1024; at least as many as there are senders.
  uint16_t slots;
  // Largest body, bytes.
  uint16_t body_bytes_max;
  // One of `rohrpost_overflow`.
  uint8_t overflow;
  // Senders that one participant may have there.
  uint8_t claims;
  // Packages that waited longer are dropped when their turn comes, ns; 0: never.
  uint64_t max_age_ns;
} rohrpost_mailbox_shape;

// The receiving end of a mailbox.
typedef struct rohrpost_receiver {
  // Which; 0 is none.
  uint64_t id;
} rohrpost_receiver;

// A package in hand.
typedef struct rohrpost_package {
  // Mailbox that it was sent to.
  uint32_t to;
  // Mailbox that answers go to; also names the sender.
  uint32_t from;
  // What it is.
  int16_t kind;
  // Tells packages of one type apart.
  uint16_t id;
  // How urgent.
  uint8_t priority;
  // Bits `ROHRPOST_OPTION_...`.
  uint8_t options;
  // Bytes of the body.
  uint16_t len;
  // The body, in shared memory.
  const uint8_t *body;
  // When it was published, on the monotonic clock, ns.
  uint64_t published_ns;
} rohrpost_package;

// A setting that may change while the module runs: `ROHRPOST_PARAMETER` writes it.
typedef struct rohrpost_parameter {
  // Its name as the configuration has it, type, unit, text and range.
  struct rohrpost_field field;
  // The value that it has if the configuration says none, as a user would type it.
  const char *value;
} rohrpost_parameter;

// How a function of a module ends: a code. Below 0 it has failed, and the last error says why: that of the call that
// failed, or what `rohrpost_fail` was given.
typedef int32_t rohrpost_outcome;

// Something that came of what a module follows.
typedef struct rohrpost_followed {
  // The number that `rohrpost_module_follow` gave.
  uint32_t follow;
  // Number of the data in the other's interface.
  uint16_t number;
  // The value, until the function returns; of a stream's record in shared memory.
  const uint8_t *value;
  // Its bytes.
  size_t len;
  // When it was true, ns since 1970.
  uint64_t stamp_ns;
  // Its number: of a subscription, or the lower bits of a record's.
  uint32_t sequence;
  // Values missed before it; of a stream, records lost so far.
  uint32_t missed;
} rohrpost_followed;

// A watched descriptor for which there is something to do.
typedef struct rohrpost_ready {
  // The number that `rohrpost_watch` gave.
  uint32_t watch;
  // A read will not wait: it brings bytes, the end, or an error.
  bool readable;
  // A write will not wait: it takes bytes, or brings an error.
  bool writable;
} rohrpost_ready;

// A module. One thread calls all its functions, one at a time, with `user`; any of them may be null. None of them may
// let an exception of C++ out, or leave by `longjmp`, `pthread_exit` or `pthread_cancel`: Rust has called them.
typedef struct rohrpost_module {
  // What it offers.
  const struct rohrpost_interface *interface;
  // Settings that may change while it runs.
  const struct rohrpost_parameter *parameters;
  // How many.
  size_t parameter_count;
  // Names of its other settings, see `rohrpost_module_settings`.
  const char *const *settings;
  // How many.
  size_t setting_count;
  // For the module's own use.
  void *user;
  // Once, before all others, switched off: let it follow here what it follows, and set its period. If it fails, the
  // process ends; with `ROHRPOST_CONFIGURATION` launch does not start it again.
  rohrpost_outcome (*made)(void *user);
  // Begins to work. If it fails, the module is in error and stays off.
  rohrpost_outcome (*on)(void *user);
  // Goes to its safe state: also when launch has died, and before the process ends.
  void (*off)(void *user);
  // Once a period while it is on. If it fails, the module is switched off and in error; so it is with those below.
  rohrpost_outcome (*tick)(void *user);
  // Runs a function: reads its arguments, writes its result. `ROHRPOST_MALFORMED`, when `arguments` cannot be read
  // or are not read to their end, tells the caller so, and `ROHRPOST_NO_ITEM`, when no call has failed in the
  // function or the interface does not have it, that there is no such function; the module goes on then. What a
  // function's own result says is no failure of it.
  rohrpost_outcome (*command)(void *user,
                              uint16_t number,
                              struct rohrpost_decoder *arguments,
                              struct rohrpost_encoder *reply);
  // Takes what it follows, while it is on.
  rohrpost_outcome (*received)(void *user, const struct rohrpost_followed *data);
  // A descriptor that it watches is ready, while it is on. Called again as long as there is something: read once, or
  // until there is nothing without waiting; at the end of the bytes, `rohrpost_module_unwatch`.
  rohrpost_outcome (*ready)(void *user, const struct rohrpost_ready *ready);
  // These parameters have new values by now. If it fails, the old values are put back, and the caller gets the
  // reason.
  rohrpost_outcome (*parameters_changed)(void *user, const char *const *names, size_t count);
} rohrpost_module;

// System time as this computer knows it.
typedef struct rohrpost_time {
  // Nanoseconds since 1970.
  uint64_t ns;
  // Times of different epochs cannot be subtracted.
  uint64_t epoch;
  // How far off it is at most, ns.
  uint64_t error_ns;
  // How long ago its source was last heard, ns.
  uint64_t age_ns;
} rohrpost_time;

// Which stream: the name of the module that writes it, and the number that its interface gives it.
typedef struct rohrpost_stream {
  // The module.
  uint32_t name;
  // The number.
  uint16_t number;
} rohrpost_stream;

// One of a stream's readers, with a position of its own.
typedef struct rohrpost_stream_reader {
  // Which; 0 is none.
  uint64_t id;
} rohrpost_stream_reader;

// When a record was produced, by system time.
typedef struct rohrpost_stamp {
  // Stamps of different epochs cannot be subtracted.
  uint64_t epoch;
  // Nanoseconds since 1970; not 0.
  uint64_t ns;
} rohrpost_stamp;

// What is said of a record.
typedef struct rohrpost_record_about {
  // Its number in the stream, from 0 on.
  uint64_t sequence;
  // When it was produced.
  struct rohrpost_stamp stamp;
  // When it was written, on the monotonic clock, ns.
  uint64_t written_ns;
  // Tells the runs of its writer apart.
  uint32_t incarnation;
} rohrpost_record_about;

// A record in hand.
typedef struct rohrpost_record {
  // What is said of it.
  struct rohrpost_record_about about;
  // Its bytes, in shared memory.
  const uint8_t *body;
  // How many.
  size_t len;
} rohrpost_record;

// The records around a time; both are the same when one has this very stamp.
typedef struct rohrpost_records_around {
  // The nearest that is not after.
  struct rohrpost_record_about before;
  // The nearest that is not before.
  struct rohrpost_record_about after;
} rohrpost_records_around;

// Records that a reader did not get, by cause.
typedef struct rohrpost_records_missed {
  // Lost on the way from the node that writes the stream.
  uint64_t lost;
  // Left out by the sampling of a replica.
  uint64_t sampled;
  // Overwritten before they were read.
  uint64_t passed_over;
} rohrpost_records_missed;

// What a stream is asked to be. `ROHRPOST_STREAM_DEFAULT` is one.
typedef struct rohrpost_stream_shape {
  // Largest record, bytes.
  uint32_t record_bytes;
  // Records that are kept, at least 2.
  uint32_t keep;
  // Most readers at a time, 1 to 64.
  uint16_t readers;
  // How far behind the newest a stamp may be, ns.
  uint64_t late_ns;
} rohrpost_stream_shape;

// The one writer of a stream.
typedef struct rohrpost_stream_writer {
  // Which; 0 is none.
  uint64_t id;
} rohrpost_stream_writer;

// A mailbox or stream to wait for: the `id` of a receiver or of a reader.
typedef struct rohrpost_source {
  // The handle's.
  uint64_t id;
} rohrpost_source;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Begins to read values from `len` bytes.
//
// Pointers:
// `bytes` is null, or points to `len` bytes, which stay as they are until all is read.
struct rohrpost_decoder rohrpost_decode(const void *bytes, size_t len);

// Whether all was read, and nothing is left; else `ROHRPOST_MALFORMED`.
rohrpost_code rohrpost_decoded(const struct rohrpost_decoder *decoder);

// Reads true or false; also whether an option has a value, which follows then.
bool rohrpost_get_bool(struct rohrpost_decoder *decoder);

// Reads a whole number from 0, of 8 bits.
uint8_t rohrpost_get_u8(struct rohrpost_decoder *decoder);

// Reads a whole number from 0, of 16 bits.
uint16_t rohrpost_get_u16(struct rohrpost_decoder *decoder);

// Reads a whole number from 0, of 32 bits.
uint32_t rohrpost_get_u32(struct rohrpost_decoder *decoder);

// Reads a whole number from 0, of 64 bits.
uint64_t rohrpost_get_u64(struct rohrpost_decoder *decoder);

// Reads a whole number with a sign, of 8 bits.
int8_t rohrpost_get_i8(struct rohrpost_decoder *decoder);

// Reads a whole number with a sign, of 16 bits.
int16_t rohrpost_get_i16(struct rohrpost_decoder *decoder);

// Reads a whole number with a sign, of 32 bits.
int32_t rohrpost_get_i32(struct rohrpost_decoder *decoder);

// Reads a whole number with a sign, of 64 bits.
int64_t rohrpost_get_i64(struct rohrpost_decoder *decoder);

// Reads a number with a fraction, of 32 bits.
float rohrpost_get_f32(struct rohrpost_decoder *decoder);

// Reads a number with a fraction, of 64 bits.
double rohrpost_get_f64(struct rohrpost_decoder *decoder);

// Reads a whole number from 0, of 128 bits: its lower half, and through `high` the upper one.
uint64_t rohrpost_get_u128(struct rohrpost_decoder *decoder, uint64_t *high);

// Reads a whole number with a sign, of 128 bits: its lower half, and through `high` the upper one.
uint64_t rohrpost_get_i128(struct rohrpost_decoder *decoder, int64_t *high);

// Reads a character: its number in Unicode.
uint32_t rohrpost_get_char(struct rohrpost_decoder *decoder);

// Reads the number of a variant; its fields follow.
uint32_t rohrpost_get_variant(struct rohrpost_decoder *decoder);

// Reads how many elements a list has, if there may be so many: each takes `bytes_min` bytes at least, which is 1 or
// more.
size_t rohrpost_get_length(struct rohrpost_decoder *decoder, size_t bytes_min);

// Reads bytes: where they are, and through `len` how many. They are those of the decoder, not a copy.
const uint8_t *rohrpost_get_bytes(struct rohrpost_decoder *decoder, size_t *len);

// Reads a text, which is UTF-8: where it is, and through `len` how many bytes. No zero ends it.
const char *rohrpost_get_text(struct rohrpost_decoder *decoder, size_t *len);

// The hash of an interface, by which callers and servers know that they have the same one, in whatever language each
// is written. Any thread.
//
// Pointers:
// All tables are as their texts say.
rohrpost_code rohrpost_interface_hash(const struct rohrpost_interface *interface, uint32_t *hash);

// Words for a code, in a few words; the same for all calls. Static: it is never freed. Any thread.
const char *rohrpost_error_text(int32_t code);

// What was wrong with the last call of this thread that returned a code below 0, in a sentence that names what it was
// about; empty before there was one. Read or copy it at once: the next call of this thread that fails writes there,
// and so do calls that have more to say of `ROHRPOST_NOTHING`, and the library before it calls a function of a module.
// The place belongs to the thread: it is the same each time, never null, there until the thread ends, and no other
// thread may read it. Any thread.
const char *rohrpost_last_error(void);

// Begins to write values into `room` bytes. Any thread, as for all functions of encoders and decoders: they belong to
// the caller, and need no end.
//
// Pointers:
// `bytes` is null, or points to `room` bytes, which are the encoder's until it is done.
struct rohrpost_encoder rohrpost_encode(void *bytes, size_t room);

// How many bytes were written, or `ROHRPOST_SMALL_BUFFER` when they did not fit, `ROHRPOST_VALUE` when a value cannot
// be.
rohrpost_code rohrpost_encoded(const struct rohrpost_encoder *encoder, size_t *len);

// Writes true or false; also whether an option has a value, which follows then.
void rohrpost_put_bool(struct rohrpost_encoder *encoder, bool value);

// Writes a whole number from 0, of 8 bits.
void rohrpost_put_u8(struct rohrpost_encoder *encoder, uint8_t value);

// Writes a whole number from 0, of 16 bits.
void rohrpost_put_u16(struct rohrpost_encoder *encoder, uint16_t value);

// Writes a whole number from 0, of 32 bits.
void rohrpost_put_u32(struct rohrpost_encoder *encoder, uint32_t value);

// Writes a whole number from 0, of 64 bits.
void rohrpost_put_u64(struct rohrpost_encoder *encoder, uint64_t value);

// Writes a whole number with a sign, of 8 bits.
void rohrpost_put_i8(struct rohrpost_encoder *encoder, int8_t value);

// Writes a whole number with a sign, of 16 bits.
void rohrpost_put_i16(struct rohrpost_encoder *encoder, int16_t value);

// Writes a whole number with a sign, of 32 bits.
void rohrpost_put_i32(struct rohrpost_encoder *encoder, int32_t value);

// Writes a whole number with a sign, of 64 bits.
void rohrpost_put_i64(struct rohrpost_encoder *encoder, int64_t value);

// Writes a number with a fraction, of 32 bits.
void rohrpost_put_f32(struct rohrpost_encoder *encoder, float value);

// Writes a number with a fraction, of 64 bits.
void rohrpost_put_f64(struct rohrpost_encoder *encoder, double value);

// Writes a whole number from 0, of 128 bits.
void rohrpost_put_u128(struct rohrpost_encoder *encoder, uint64_t high, uint64_t low);

// Writes a whole number with a sign, of 128 bits.
void rohrpost_put_i128(struct rohrpost_encoder *encoder, int64_t high, uint64_t low);

// Writes a character by its number in Unicode.
void rohrpost_put_char(struct rohrpost_encoder *encoder, uint32_t value);

// Writes the number of a variant; its fields follow.
void rohrpost_put_variant(struct rohrpost_encoder *encoder, uint32_t variant);

// Writes how many elements a list has; they follow.
void rohrpost_put_length(struct rohrpost_encoder *encoder, size_t length);

// Writes bytes, behind how many they are.
//
// Pointers:
// `value` is null, or points to `len` bytes.
void rohrpost_put_bytes(struct rohrpost_encoder *encoder, const void *value, size_t len);

// Writes a text of `len` bytes, which are UTF-8.
//
// Pointers:
// `value` is null, or points to `len` bytes.
void rohrpost_put_text(struct rohrpost_encoder *encoder, const char *value, size_t len);

// Opens a mailbox for sending: one of this node, or one that a router leads to.
//
// The caller owns the sender, and closes it by `rohrpost_sender_close`. Thread: that of the node, as for all calls
// with the sender.
rohrpost_code rohrpost_sender_open(struct rohrpost_node node, uint32_t name, struct rohrpost_sender *sender);

// Closes a sender; what it has lent is given up.
rohrpost_code rohrpost_sender_close(struct rohrpost_sender sender);

// Sends a package with a body of `len` bytes, which are copied. No system call unless the receiver sleeps.
//
// Pointers:
// `body` is null, or points to `len` bytes.
rohrpost_code rohrpost_send(struct rohrpost_sender sender,
                            const struct rohrpost_label *label,
                            const void *body,
                            size_t len);

// Lends a slot of the mailbox to write a package in place: `body` is its place, of `room` bytes. Until it is sent by
// `rohrpost_loan_send` or given up by `rohrpost_loan_drop`, the sender is busy. The place is aligned to nothing.
rohrpost_code rohrpost_loan(struct rohrpost_sender sender, uint8_t priority, uint8_t **body, size_t *room);

// Sends the first `len` bytes of what is lent. The priority is the one that it was lent for. It is no longer lent
// then, also when this fails, but for a null `label`.
rohrpost_code rohrpost_loan_send(struct rohrpost_sender sender, const struct rohrpost_label *label, size_t len);

// Gives up what is lent: nothing is sent.
rohrpost_code rohrpost_loan_drop(struct rohrpost_sender sender);

// Makes this process the receiver of a mailbox; with a null `shape`, of the usual one. What an earlier receiver left
// there is received first, if the shape is the same.
//
// The caller owns the receiver, and closes it by `rohrpost_receiver_close` or `rohrpost_receiver_remove`. Thread: that
// of the node, as for all calls with the receiver.
rohrpost_code rohrpost_receiver_open(struct rohrpost_node node,
                                     uint32_t name,
                                     const struct rohrpost_mailbox_shape *shape,
                                     struct rohrpost_receiver *receiver);

// Takes the most important package, to be read in place. Waits for one at most `timeout_ns`, 0: not at all, below 0:
// for ever, which no signal ends (`rohrpost_wait` returns then); `ROHRPOST_NOTHING` when there is none. The package is
// in hand until the next such call, whatever that returns, or until it is released or the receiver is closed. Its
// bytes are aligned to nothing.
rohrpost_code rohrpost_receive(struct rohrpost_receiver receiver, int64_t timeout_ns, struct rohrpost_package *package);

// The same; before it sleeps, it looks again and again for `spin_ns`, which takes a whole processor.
rohrpost_code rohrpost_receive_spinning(struct rohrpost_receiver receiver,
                                        int64_t timeout_ns,
                                        uint64_t spin_ns,
                                        struct rohrpost_package *package);

// Frees the slot of the package in hand, if there is one.
rohrpost_code rohrpost_receiver_release(struct rohrpost_receiver receiver);

// Closes a receiver. The mailbox stays, and with it what waits there, for the next one.
rohrpost_code rohrpost_receiver_close(struct rohrpost_receiver receiver);

// Closes a receiver and removes its mailbox; `lost`, which may be null, is how many packages waited there.
rohrpost_code rohrpost_receiver_remove(struct rohrpost_receiver receiver, size_t *lost);

// Says why a function of a module fails, and returns `ROHRPOST_FAILED` for it to return. Any thread.
//
// Pointers:
// The text is null or ends with a zero.
rohrpost_code rohrpost_fail(const char *why);

// Runs a module, as launch asks for it, until it is told to end; returns the exit code of the process. `main` calls
// it, with its own arguments, and nothing else of the process may then handle SIGTERM, SIGINT and SIGHUP. SIGPIPE is
// ignored from then on.
//
// Pointers:
// All tables are as their texts say, and stay until it returns. `arguments` is null, or points to `count` texts that
// end with a zero.
int rohrpost_module_run(const struct rohrpost_module *module, int count, const char *const *arguments);

// Says a line, at a `rohrpost_level`. Any thread; before the module runs, nobody hears it.
//
// Pointers:
// The text is null or ends with a zero.
rohrpost_code rohrpost_say(uint8_t level, const char *line);

// The module's own name. Only a function of the module may call this, and all `rohrpost_module_...` below.
rohrpost_code rohrpost_module_name(uint32_t *name);

// System time now.
rohrpost_code rohrpost_module_now(struct rohrpost_time *now);

// Has `tick` called once in this time, ns, from now on.
rohrpost_code rohrpost_module_period(uint64_t period_ns);

// The settings that are no parameters, as an object in JSON, with a zero behind it. If the buffer is too small, the
// last error says how many bytes are needed.
//
// Pointers:
// `buffer` is null, or has room for `size` bytes.
rohrpost_code rohrpost_module_settings(char *buffer, size_t size);

// The present value of a parameter, to be read at once: it is there until the function ends, or sets one.
//
// Pointers:
// The text is null or ends with a zero.
rohrpost_code rohrpost_module_parameter(const char *name, struct rohrpost_decoder *value);

// The module sets a parameter of its own.
//
// Pointers:
// The text is null or ends with a zero; `value` is null, or points to `len` bytes.
rohrpost_code rohrpost_module_set_parameter(const char *name, const void *value, size_t len);

// Publishes a value of the module's data or of a stream, that was true at `stamp_ns`, system time; 0: now. The bytes
// are copied.
//
// Pointers:
// `value` is null, or points to `len` bytes.
rohrpost_code rohrpost_module_publish(uint16_t number, uint64_t stamp_ns, const void *value, size_t len);

// Runs a function of another module, `motor.0`, by its number: arguments are values one behind the other, and so is
// the result, to be read from `reply`; it is there until the next such call, and empty when this fails. Waits for it
// at most `timeout_ns`, and all else of the module with it. The first call asks the other one what it offers.
//
// `interface` is the hash of the interface that the caller goes by: `MOTOR_HASH` of the header that
// `rohrpost interface generate --lang c` writes, or what `rohrpost_interface_hash` gives. Nothing is run by another
// one: `ROHRPOST_FAULT`, and the last error says that they differ.
//
// Pointers:
// The text is null or ends with a zero; `arguments` is null, or points to `len` bytes.
rohrpost_code rohrpost_module_call(const char *module,
                                   uint32_t interface,
                                   uint16_t function,
                                   const void *arguments,
                                   size_t len,
                                   uint64_t timeout_ns,
                                   struct rohrpost_decoder *reply);

// Asks another module for the newest value of its data of this number: `reply` is its time (ns since 1970, a u64),
// then the value. For the rest as `rohrpost_module_call`.
//
// Pointers:
// The text is null or ends with a zero.
rohrpost_code rohrpost_module_get(const char *module,
                                  uint32_t interface,
                                  uint16_t number,
                                  uint64_t timeout_ns,
                                  struct rohrpost_decoder *reply);

// Has `ready` called when a descriptor is ready for `interest`, bits `ROHRPOST_READ` and `ROHRPOST_WRITE`; `watch` is
// its number there. The library keeps a duplicate, the caller its own.
rohrpost_code rohrpost_module_watch(int descriptor, uint8_t interest, uint32_t *watch);

// Watches it no longer.
rohrpost_code rohrpost_module_unwatch(uint32_t watch);

// Follows data or a stream of another module, by the names of both, as one of `rohrpost_follow` says, once in
// `period_ns` if that is a period. What comes is given to `received`, with the number that this gives. The other
// module need not run yet. Only a function of the module may call this.
//
// Pointers:
// Texts are null or end with a zero.
rohrpost_code rohrpost_module_follow(const char *module,
                                     const char *item,
                                     uint8_t how,
                                     uint64_t period_ns,
                                     uint32_t *follow);

// Begins a record of a stream with a type that ends with bytes: `front` are the values before them and a length of 0,
// and `room` becomes the place for `len` bytes: in shared memory, or, of a stream with records of 4096 bytes at most,
// beside it, from where they are copied. It is aligned to nothing. Fill them, then `rohrpost_module_finish` or
// `rohrpost_module_abandon`, in the same function. Only a function of the module may call this, and those two.
//
// Pointers:
// `front` is null, or points to `front_len` bytes.
rohrpost_code rohrpost_module_begin(uint16_t number,
                                    uint64_t stamp_ns,
                                    const void *front,
                                    size_t front_len,
                                    size_t len,
                                    uint8_t **room);

// Makes the record that is begun the newest of its stream; `sequence`, which may be null, is its number.
rohrpost_code rohrpost_module_finish(uint64_t *sequence);

// Gives up the record that is begun; nothing is written.
rohrpost_code rohrpost_module_abandon(void);

// Takes part in the node that launch has started this process on; the environment says which. The module itself takes
// part by `rohrpost_module_run`, so this is for what it does besides: without a name, as launch asks for one process
// of a name.
//
// The caller owns the node, and closes it by `rohrpost_node_close`. A node belongs to the thread that opens it; each
// thread opens its own, and takes one of the node's 256 places.
rohrpost_code rohrpost_node_open(struct rohrpost_node *node);

// Takes part in a node of a configuration, by the file's path. `node_name` may be null if the configuration has the
// module. `module` is the name that this process takes part as, such as "tool.70"; null: without a name.
//
// Owner and thread: as for `rohrpost_node_open`.
//
// Pointers:
// Texts are null or end with a zero.
rohrpost_code rohrpost_node_open_configured(const char *config,
                                            const char *node_name,
                                            const char *module,
                                            struct rohrpost_node *node);

// Takes part in the node with this directory, as the module of this name (0: without a name). Names are numbers then,
// such as "1.200.0.0". With `create`, makes the directory if there is none.
//
// Owner and thread: as for `rohrpost_node_open`.
//
// Pointers:
// The text is null or ends with a zero.
rohrpost_code rohrpost_node_open_directory(const char *directory,
                                           bool create,
                                           uint32_t module,
                                           struct rohrpost_node *node);

// Closes a node. What was opened by it stays open. Thread: that of the node.
rohrpost_code rohrpost_node_close(struct rohrpost_node node);

// The name that a text means: "motor.0", "motor.0.2", "1.200.0.2". Thread: that of the node.
//
// Pointers:
// The text is null or ends with a zero.
rohrpost_code rohrpost_name_parse(struct rohrpost_node node, const char *name_text, uint32_t *name);

// Writes a name as text into a buffer, with a zero behind it. If the buffer is too small, the last error says how many
// bytes are needed. Thread: that of the node.
//
// Pointers:
// `buffer` is null, or has room for `size` bytes.
rohrpost_code rohrpost_name_text(struct rohrpost_node node, uint32_t name, char *buffer, size_t size);

// System time now. No system call. Thread: that of the node.
rohrpost_code rohrpost_time_now(struct rohrpost_node node, struct rohrpost_time *now);

// Version of the layout of shared memory that this library reads: both sides of a mailbox have the same. Any thread.
unsigned int rohrpost_layout_version(void);

// Opens a stream to read, from what is written next on. There may be no such stream yet. Takes one of its places for
// readers.
//
// The caller owns the reader, and closes it by `rohrpost_stream_reader_close`. Thread: that of the node, as for all
// calls with the reader.
rohrpost_code rohrpost_stream_reader_open(struct rohrpost_node node,
                                          struct rohrpost_stream stream,
                                          struct rohrpost_stream_reader *reader);

// Closes a reader.
rohrpost_code rohrpost_stream_reader_close(struct rohrpost_stream_reader reader);

// Takes the next record, to be read in place. Waits for one at most `timeout_ns`, 0: not at all, below 0: for ever,
// which no signal ends (`rohrpost_wait` returns then); `ROHRPOST_NOTHING` when there is none. `ROHRPOST_LOST` when the
// writer has passed this reader: `lost`, which may be null, is how many records; then call it again.
//
// The record is in hand until the next call that takes one from this reader, whatever that returns, or until it is
// released or the reader is closed; meanwhile the writer goes round it. Its bytes are aligned to nothing.
rohrpost_code rohrpost_stream_next(struct rohrpost_stream_reader reader,
                                   int64_t timeout_ns,
                                   struct rohrpost_record *record,
                                   uint64_t *lost);

// Takes the newest record, to be read in place, as `rohrpost_stream_next` does; the position stays.
// `ROHRPOST_NOTHING` before the first.
rohrpost_code rohrpost_stream_newest(struct rohrpost_stream_reader reader, struct rohrpost_record *record);

// Takes the record of this sequence, to be read in place, as `rohrpost_stream_next` does; the position stays.
// `ROHRPOST_NOTHING` when it is there no more, or not yet.
rohrpost_code rohrpost_stream_record(struct rohrpost_stream_reader reader,
                                     uint64_t sequence,
                                     struct rohrpost_record *record);

// The two records around a time, for interpolation; `rohrpost_stream_record` reads each. `ROHRPOST_BUSY` while a
// record is in hand: release it first. `ROHRPOST_NOTHING` when there are none (yet): the last error says exactly why.
rohrpost_code rohrpost_stream_around(struct rohrpost_stream_reader reader,
                                     struct rohrpost_stamp at,
                                     struct rohrpost_records_around *records);

// Lets the writer have the place of the record in hand, if there is one.
rohrpost_code rohrpost_stream_reader_release(struct rohrpost_stream_reader reader);

// How many records this reader did not get since it was opened, by cause. `ROHRPOST_BUSY` while a record is in hand:
// release it first.
rohrpost_code rohrpost_stream_missed(struct rohrpost_stream_reader reader, struct rohrpost_records_missed *missed);

// Makes this process the writer of a stream; with a null `shape`, of the usual one. Records that an earlier writer
// left there stay, if the shape is the same.
//
// The caller owns the writer, and closes it by `rohrpost_stream_writer_close`. Thread: that of the node, as for all
// calls with the writer.
rohrpost_code rohrpost_stream_writer_open(struct rohrpost_node node,
                                          struct rohrpost_stream stream,
                                          const struct rohrpost_stream_shape *ring,
                                          struct rohrpost_stream_writer *writer);

// Closes a writer; a record that is begun is abandoned. The stream stays, and with it its records.
rohrpost_code rohrpost_stream_writer_close(struct rohrpost_stream_writer writer);

// Writes a record of `len` bytes, which are copied; `sequence`, which may be null, becomes its number in the stream.
// Slow readers do not hinder it.
//
// Pointers:
// `body` is null, or points to `len` bytes.
rohrpost_code rohrpost_stream_write(struct rohrpost_stream_writer writer,
                                    struct rohrpost_stamp at,
                                    const void *body,
                                    size_t len,
                                    uint64_t *sequence);

// Begins a record that is written in place: `body` is its place, of `room` bytes, where anything may stand. Readers
// see it when it is finished by `rohrpost_stream_finish`; until then, or until `rohrpost_stream_abandon`, the writer
// is busy. The place is aligned to nothing.
rohrpost_code rohrpost_stream_begin(struct rohrpost_stream_writer writer,
                                    struct rohrpost_stamp at,
                                    uint8_t **body,
                                    size_t *room);

// Makes the first `len` bytes of what is begun the next record; `sequence` may be null. It is no longer begun then,
// also when this fails.
rohrpost_code rohrpost_stream_finish(struct rohrpost_stream_writer writer, size_t len, uint64_t *sequence);

// Gives up what is begun: nothing is written.
rohrpost_code rohrpost_stream_abandon(struct rohrpost_stream_writer writer);

// Watches a file descriptor for `interest`, bits `ROHRPOST_READ` and `ROHRPOST_WRITE`: `rohrpost_wait` returns when it
// is ready. The library keeps a duplicate of the descriptor, the caller keeps its own.
//
// Until `rohrpost_unwatch`. Thread: that of the node.
rohrpost_code rohrpost_watch(struct rohrpost_node node, int descriptor, uint8_t interest, uint32_t *watch);

// Watches it no longer. Thread: that of the node.
rohrpost_code rohrpost_unwatch(struct rohrpost_node node, uint32_t watch);

// Waits until one of `count` mailboxes and streams has something or a watched descriptor is ready, at most
// `timeout_ns`, 0: not at all, below 0: for ever; `ROHRPOST_NOTHING` when nothing is there then. It may return early
// for no reason, also for a signal: take from each what is there, and wait again. What has a package or record in hand
// cannot be waited for: release it first.
//
// Thread: that of the node and of all sources, which were opened by this node.
//
// Pointers:
// `sources` is null, or points to `count` of them.
rohrpost_code rohrpost_wait(struct rohrpost_node node,
                            const struct rohrpost_source *sources,
                            size_t count,
                            int64_t timeout_ns);

// `ROHRPOST_BUSY` while a package or record of this receiver or reader is in hand. Thread: that of the source.
rohrpost_code rohrpost_source_idle(struct rohrpost_source source);

// Tells a descriptor that was ready when `rohrpost_wait` returned; each is told once, then `ROHRPOST_NOTHING`. Thread:
// that of the node.
rohrpost_code rohrpost_next_ready(struct rohrpost_node node, struct rohrpost_ready *ready);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ROHRPOST_H */
