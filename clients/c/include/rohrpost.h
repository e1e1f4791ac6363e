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
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum rohrpost_code rohrpost_code;
#else
typedef int32_t rohrpost_code;
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

// Reads values one behind the other. A value that is not there is 0, and all behind it.
typedef struct rohrpost_decoder {
  // What is not read yet.
  const uint8_t *bytes;
  // How many these are.
  size_t left;
  // A code: how it went until now. Once it is not `ROHRPOST_OK`, nothing more is read.
  int32_t state;
} rohrpost_decoder;

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

// A watched descriptor for which there is something to do.
typedef struct rohrpost_ready {
  // The number that `rohrpost_watch` gave.
  uint32_t watch;
  // A read will not wait: it brings bytes, the end, or an error.
  bool readable;
  // A write will not wait: it takes bytes, or brings an error.
  bool writable;
} rohrpost_ready;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Words for a code, in a few words; the same for all calls. Static: it is never freed. Any thread.
const char *rohrpost_error_text(int32_t code);

// What was wrong with the last call of this thread that returned a code below 0, in a sentence that names what it was
// about. Valid until the next call that fails in this thread. Any thread.
const char *rohrpost_last_error(void);

// Opens a mailbox for sending: one of this node, or one that a router leads to.
//
// The caller owns the sender, and closes it by `rohrpost_sender_close`. Thread: that of the node, as for all calls with
// the sender.
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
// `rohrpost_loan_send` or given up by `rohrpost_loan_drop`, the sender is busy.
rohrpost_code rohrpost_loan(struct rohrpost_sender sender, uint8_t priority, uint8_t **body, size_t *room);

// Sends the first `len` bytes of what is lent. The priority is the one that it was lent for. It is no longer lent then,
// also when this fails.
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
// for ever; `ROHRPOST_NOTHING` when there is none. The package is in hand until the next package is taken, it is
// released, or the receiver is closed.
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

// Takes part in the node that launch has started this process on, as its module. The environment says which.
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

// Begins to write values into `room` bytes. Any thread, as for all functions of encoders and decoders: they belong to
// the caller, and need no end.
//
// Pointers:
// `bytes` is null, or points to `room` bytes, which are the encoder's until it is done.
struct rohrpost_encoder rohrpost_encode(void *bytes, size_t room);

// How many bytes were written, or `ROHRPOST_SMALL_BUFFER` when they did not fit, `ROHRPOST_VALUE` when a value cannot
// be.
rohrpost_code rohrpost_encoded(const struct rohrpost_encoder *encoder, size_t *len);

// Begins to read values from `len` bytes.
//
// Pointers:
// `bytes` is null, or points to `len` bytes, which stay as they are until all is read.
struct rohrpost_decoder rohrpost_decode(const void *bytes, size_t len);

// Whether all was read, and nothing is left; else `ROHRPOST_MALFORMED`.
rohrpost_code rohrpost_decoded(const struct rohrpost_decoder *decoder);

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

// Takes the next record, to be read in place. Waits for one at most `timeout_ns`, 0: not at all, below 0: for ever;
// `ROHRPOST_NOTHING` when there is none. `ROHRPOST_LOST` when the writer has passed this reader: `lost`, which may be
// null, is how many records; then call it again. The record is in hand until the next one is taken, it is released, or
// the reader is closed; meanwhile the writer goes round it.
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

// The two records around a time, for interpolation; `rohrpost_stream_record` reads each. What is in hand is released.
// `ROHRPOST_NOTHING` when there are none (yet): the last error says exactly why.
rohrpost_code rohrpost_stream_around(struct rohrpost_stream_reader reader,
                                     struct rohrpost_stamp at,
                                     struct rohrpost_records_around *records);

// Lets the writer have the place of the record in hand, if there is one.
rohrpost_code rohrpost_stream_reader_release(struct rohrpost_stream_reader reader);

// How many records this reader did not get since it was opened, by cause. What is in hand is released.
rohrpost_code rohrpost_stream_missed(struct rohrpost_stream_reader reader, struct rohrpost_records_missed *missed);

// Makes this process the writer of a stream; with a null `shape`, of the usual one. Records that an earlier writer left
// there stay, if the shape is the same.
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

// Begins a record that is written in place: `body` is its place, of `room` bytes, where anything may stand. Readers see
// it when it is finished by `rohrpost_stream_finish`; until then, or until `rohrpost_stream_abandon`, the writer is
// busy.
rohrpost_code rohrpost_stream_begin(struct rohrpost_stream_writer writer,
                                    struct rohrpost_stamp at,
                                    uint8_t **body,
                                    size_t *room);

// Makes the first `len` bytes of what is begun the next record; `sequence` may be null. It is no longer begun then, also
// when this fails.
rohrpost_code rohrpost_stream_finish(struct rohrpost_stream_writer writer,
                                     size_t len,
                                     uint64_t *sequence);

// Gives up what is begun: nothing is written.
rohrpost_code rohrpost_stream_abandon(struct rohrpost_stream_writer writer);

// Watches a file descriptor for `interest`, bits `ROHRPOST_READ` and `ROHRPOST_WRITE`: `rohrpost_wait` returns when it
// is ready. The library keeps a duplicate of the descriptor, the caller keeps its own.
//
// Until `rohrpost_unwatch`. Thread: that of the node.
rohrpost_code rohrpost_watch(struct rohrpost_node node, int descriptor, uint8_t interest, uint32_t *watch);

// Watches it no longer. Thread: that of the node.
rohrpost_code rohrpost_unwatch(struct rohrpost_node node, uint32_t watch);

// Waits until one of `count` mailboxes and streams has something, a watched descriptor is ready, or the time has passed
// (`ROHRPOST_NOTHING`): at most `timeout_ns`, below 0 for ever. It may return early for no reason, and what came at the
// last moment is there too: take from each what is there, and wait again. What has a package or record in hand cannot be
// waited for: release it first.
//
// Thread: that of the node and of all sources, which were opened by this node.
//
// Pointers:
// `sources` is null, or points to `count` of them.
rohrpost_code rohrpost_wait(struct rohrpost_node node,
                            const struct rohrpost_source *sources,
                            size_t count,
                            int64_t timeout_ns);

// Tells a descriptor that was ready when `rohrpost_wait` returned; each is told once, then `ROHRPOST_NOTHING`. Thread:
// that of the node.
rohrpost_code rohrpost_next_ready(struct rohrpost_node node, struct rohrpost_ready *ready);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ROHRPOST_H */
