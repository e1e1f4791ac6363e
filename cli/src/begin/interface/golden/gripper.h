/* Interface Gripper of class gripper.
 *
 * Made by `rohrpost interface generate --lang c`: do not change it here, but where it was written, and make this anew.
 * C11 or C++17. Reading: `…_decode` with memory for elements of lists; texts and bytes stay in the buffer. Writing:
 * `…_encode` into a buffer; its length is told also when there is no room. */
#ifndef ROHRPOST_GRIPPER_341216C5
#define ROHRPOST_GRIPPER_341216C5

/* Postcard in C: what every header of an interface needs, once. C11 or C++17, and nothing but the standard's headers.
 *
 * Nothing here allocates. What is read has texts and bytes where they lie, in the buffer that was read; elements of
 * lists go into memory of the caller's. No input makes it read or write beyond what it was given: whatever is wrong
 * first is kept in `code`, and from then on nothing is read or written. */
#ifndef ROHRPOST_POSTCARD
#define ROHRPOST_POSTCARD

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/** What went wrong; 0 is nothing. */
typedef enum rp_code {
    RP_OK = 0,
    RP_SHORT = 1,    /**< The bytes end too early. */
    RP_LONG = 2,     /**< Bytes are left behind the value. */
    RP_FLAG = 3,     /**< A byte that is neither 0 nor 1. */
    RP_NUMBER = 4,   /**< A number that does not fit its type. */
    RP_TEXT = 5,     /**< A text that is not UTF-8, or a character that is not exactly one. */
    RP_VARIANT = 6,  /**< A variant that the enum does not have. */
    RP_LENGTH = 7,   /**< A list claims more elements than the rest of the bytes can hold. */
    RP_ROOM = 8      /**< No room: in the memory for lists, or in the buffer that is written. */
} rp_code;

/** Words for a code. */
static inline const char *rp_code_text(rp_code code) {
    switch (code) {
    case RP_OK: return "nothing is wrong";
    case RP_SHORT: return "the bytes end too early";
    case RP_LONG: return "bytes are left behind the value";
    case RP_FLAG: return "a byte that is neither 0 nor 1";
    case RP_NUMBER: return "a number that does not fit its type";
    case RP_TEXT: return "a text that is not UTF-8, or not exactly one character";
    case RP_VARIANT: return "a variant that the enum does not have";
    case RP_LENGTH: return "a list claims more elements than there are bytes";
    case RP_ROOM: return "no room";
    }
    return "no code of this version";
}

/** A text: UTF-8, `length` bytes, no zero behind it. Whoever made it owns it. */
typedef struct rp_text {
    const char *text;
    size_t length;
} rp_text;

/** Bytes; whoever made them owns them. */
typedef struct rp_bytes {
    const uint8_t *bytes;
    size_t length;
} rp_bytes;

/** A whole number of 128 bits. */
typedef struct rp_u128 {
    uint64_t low;
    uint64_t high;
} rp_u128;

/** A whole number of 128 bits with a sign, as two's complement. */
typedef struct rp_i128 {
    uint64_t low;
    uint64_t high;
} rp_i128;

/** What takes no bytes; C has no type of this kind. */
typedef uint8_t rp_nothing;

/** A text of a C string. */
static inline rp_text rp_text_of(const char *text) {
    rp_text made;
    made.text = text;
    made.length = strlen(text);
    return made;
}

/* Writing. */

/** Where a value is written. `used` counts on when there is no room, so that it says how much is needed. */
typedef struct rp_packer {
    uint8_t *bytes;
    size_t room;
    size_t used;
    rp_code code;
} rp_packer;

static inline void rp_pack_fail(rp_packer *to, rp_code code) {
    if (to->code == RP_OK) {
        to->code = code;
    }
}

static inline void rp_pack_raw(rp_packer *to, const void *bytes, size_t length) {
    if (length == 0) {
        return;
    }
    if (to->used <= to->room && length <= to->room - to->used) {
        memcpy(to->bytes + to->used, bytes, length);
    } else {
        rp_pack_fail(to, RP_ROOM);
    }
    to->used = length > SIZE_MAX - to->used ? SIZE_MAX : to->used + length;
}

static inline void rp_pack_u8(rp_packer *to, uint8_t value) { rp_pack_raw(to, &value, 1); }
static inline void rp_pack_i8(rp_packer *to, int8_t value) { rp_pack_u8(to, (uint8_t)value); }
static inline void rp_pack_bool(rp_packer *to, bool value) { rp_pack_u8(to, value ? 1 : 0); }
static inline void rp_pack_nothing(rp_packer *to, rp_nothing value) { (void)to; (void)value; }

static inline void rp_pack_u128(rp_packer *to, rp_u128 value) {
    while (value.high != 0 || value.low >= 0x80) {
        rp_pack_u8(to, (uint8_t)(value.low & 0x7f) | 0x80);
        value.low = (value.low >> 7) | (value.high << 57);
        value.high >>= 7;
    }
    rp_pack_u8(to, (uint8_t)value.low);
}

static inline void rp_pack_u64(rp_packer *to, uint64_t value) {
    rp_u128 wide;
    wide.low = value;
    wide.high = 0;
    rp_pack_u128(to, wide);
}

static inline void rp_pack_u32(rp_packer *to, uint32_t value) { rp_pack_u64(to, value); }
static inline void rp_pack_u16(rp_packer *to, uint16_t value) { rp_pack_u64(to, value); }

static inline void rp_pack_i64(rp_packer *to, int64_t value) {
    rp_pack_u64(to, ((uint64_t)value << 1) ^ (value < 0 ? UINT64_MAX : 0));
}

static inline void rp_pack_i32(rp_packer *to, int32_t value) { rp_pack_i64(to, value); }
static inline void rp_pack_i16(rp_packer *to, int16_t value) { rp_pack_i64(to, value); }

static inline void rp_pack_i128(rp_packer *to, rp_i128 value) {
    uint64_t sign = (value.high >> 63) != 0 ? UINT64_MAX : 0;
    rp_u128 zigzag;
    zigzag.high = ((value.high << 1) | (value.low >> 63)) ^ sign;
    zigzag.low = (value.low << 1) ^ sign;
    rp_pack_u128(to, zigzag);
}

static inline void rp_pack_f32(rp_packer *to, float value) {
    uint32_t bits;
    uint8_t bytes[4];
    int at;
    memcpy(&bits, &value, sizeof bits);
    for (at = 0; at < 4; at++) {
        bytes[at] = (uint8_t)(bits >> (8 * at));
    }
    rp_pack_raw(to, bytes, sizeof bytes);
}

static inline void rp_pack_f64(rp_packer *to, double value) {
    uint64_t bits;
    uint8_t bytes[8];
    int at;
    memcpy(&bits, &value, sizeof bits);
    for (at = 0; at < 8; at++) {
        bytes[at] = (uint8_t)(bits >> (8 * at));
    }
    rp_pack_raw(to, bytes, sizeof bytes);
}

static inline void rp_pack_bytes(rp_packer *to, rp_bytes value) {
    rp_pack_u64(to, value.length);
    rp_pack_raw(to, value.bytes, value.length);
}

/** Length of the first character of UTF-8, and the character; 0 if there is none. */
static inline size_t rp_first_char(const uint8_t *bytes, size_t length, uint32_t *value) {
    static const uint32_t least[5] = {0, 0, 0x80, 0x800, 0x10000};
    size_t wanted, at;
    if (length == 0) {
        return 0;
    }
    *value = bytes[0];
    if (bytes[0] < 0x80) {
        return 1;
    }
    wanted = bytes[0] >= 0xf0 ? 4 : bytes[0] >= 0xe0 ? 3 : 2;
    if (bytes[0] < 0xc2 || bytes[0] > 0xf4 || wanted > length) {
        return 0;
    }
    *value = bytes[0] & (0x7fu >> wanted);
    for (at = 1; at < wanted; at++) {
        if ((bytes[at] & 0xc0) != 0x80) {
            return 0;
        }
        *value = (*value << 6) | (bytes[at] & 0x3f);
    }
    if (*value < least[wanted] || *value > 0x10ffff || (*value >= 0xd800 && *value < 0xe000)) {
        return 0;
    }
    return wanted;
}

static inline bool rp_is_text(const uint8_t *bytes, size_t length) {
    uint32_t value = 0;
    size_t at = 0;
    while (at < length) {
        size_t taken = rp_first_char(bytes + at, length - at, &value);
        if (taken == 0) {
            return false;
        }
        at += taken;
    }
    return true;
}

static inline void rp_pack_text(rp_packer *to, rp_text value) {
    rp_bytes bytes;
    bytes.bytes = (const uint8_t *)value.text;
    bytes.length = value.length;
    if (!rp_is_text(bytes.bytes, bytes.length)) {
        rp_pack_fail(to, RP_TEXT);
        return;
    }
    rp_pack_bytes(to, bytes);
}

static inline void rp_pack_char(rp_packer *to, uint32_t value) {
    uint8_t bytes[5];
    uint8_t length = value < 0x80 ? 1 : value < 0x800 ? 2 : value < 0x10000 ? 3 : 4;
    uint8_t at;
    if (value > 0x10ffff || (value >= 0xd800 && value < 0xe000)) {
        rp_pack_fail(to, RP_TEXT);
        return;
    }
    bytes[0] = length;
    for (at = length; at > 1; at--) {
        bytes[at] = (uint8_t)(0x80 | (value & 0x3f));
        value >>= 6;
    }
    bytes[1] = (uint8_t)(length == 1 ? value : ((0xf00u >> length) & 0xf0u) | value);
    rp_pack_raw(to, bytes, (size_t)length + 1);
}

/* Reading. */

/** Values without bytes, in one message. */
#define RP_EMPTY_MAX 65536

/** Where a value is read, and memory for elements of its lists. */
typedef struct rp_unpacker {
    const uint8_t *bytes;
    size_t left;
    uint8_t *memory;
    size_t memory_left;
    size_t empty_left;
    rp_code code;
} rp_unpacker;

static inline void rp_unpack_fail(rp_unpacker *from, rp_code code) {
    if (from->code == RP_OK) {
        from->code = code;
    }
}

static inline rp_unpacker rp_unpacker_of(const void *bytes, size_t length, void *memory, size_t memory_bytes) {
    rp_unpacker from;
    from.bytes = (const uint8_t *)bytes;
    from.left = length;
    from.memory = (uint8_t *)memory;
    from.memory_left = memory_bytes;
    from.empty_left = RP_EMPTY_MAX;
    from.code = RP_OK;
    return from;
}

/** So many bytes where they lie; null, and an error, if there are not so many. */
static inline const uint8_t *rp_unpack_raw(rp_unpacker *from, uint64_t length) {
    const uint8_t *taken = from->bytes;
    if (from->code != RP_OK || length > from->left) {
        rp_unpack_fail(from, RP_SHORT);
        return NULL;
    }
    if (length != 0) {
        from->bytes += length;
        from->left -= (size_t)length;
    }
    return taken;
}

static inline uint8_t rp_unpack_u8(rp_unpacker *from) {
    const uint8_t *taken = rp_unpack_raw(from, 1);
    return taken == NULL ? 0 : *taken;
}

static inline int8_t rp_unpack_i8(rp_unpacker *from) {
    uint8_t value = rp_unpack_u8(from);
    return (int8_t)(value < 0x80 ? (int)value : (int)value - 0x100);
}

static inline bool rp_unpack_bool(rp_unpacker *from) {
    uint8_t value = rp_unpack_u8(from);
    if (value > 1) {
        rp_unpack_fail(from, RP_FLAG);
    }
    return value == 1;
}

static inline rp_nothing rp_unpack_nothing(rp_unpacker *from) { (void)from; return 0; }

/** A number of at most so many bits. */
static inline rp_u128 rp_unpack_varint(rp_unpacker *from, unsigned bits) {
    rp_u128 value;
    unsigned shift;
    value.low = 0;
    value.high = 0;
    for (shift = 0; shift < bits; shift += 7) {
        uint8_t byte = rp_unpack_u8(from);
        uint64_t seven = byte & 0x7f;
        if (bits - shift < 7 && (seven >> (bits - shift)) != 0) {
            break;
        }
        if (shift < 64) {
            value.low |= seven << shift;
            value.high |= shift > 57 ? seven >> (64 - shift) : 0;
        } else {
            value.high |= seven << (shift - 64);
        }
        if (byte < 0x80) {
            return value;
        }
    }
    rp_unpack_fail(from, RP_NUMBER);
    value.low = 0;
    value.high = 0;
    return value;
}

static inline rp_u128 rp_unpack_u128(rp_unpacker *from) { return rp_unpack_varint(from, 128); }
static inline uint64_t rp_unpack_u64(rp_unpacker *from) { return rp_unpack_varint(from, 64).low; }
static inline uint32_t rp_unpack_u32(rp_unpacker *from) { return (uint32_t)rp_unpack_varint(from, 32).low; }
static inline uint16_t rp_unpack_u16(rp_unpacker *from) { return (uint16_t)rp_unpack_varint(from, 16).low; }

static inline rp_i128 rp_unpack_zigzag(rp_unpacker *from, unsigned bits) {
    rp_u128 raw = rp_unpack_varint(from, bits);
    uint64_t sign = (raw.low & 1) != 0 ? UINT64_MAX : 0;
    rp_i128 value;
    value.low = ((raw.low >> 1) | (raw.high << 63)) ^ sign;
    value.high = (raw.high >> 1) ^ sign;
    return value;
}

static inline rp_i128 rp_unpack_i128(rp_unpacker *from) { return rp_unpack_zigzag(from, 128); }

static inline int64_t rp_unpack_i64(rp_unpacker *from) {
    uint64_t bits = rp_unpack_zigzag(from, 64).low;
    return bits <= INT64_MAX ? (int64_t)bits : -(int64_t)(UINT64_MAX - bits) - 1;
}

static inline int64_t rp_unpack_small(rp_unpacker *from, unsigned bits) {
    uint64_t raw = rp_unpack_zigzag(from, bits).low;
    return raw <= INT64_MAX ? (int64_t)raw : -(int64_t)(UINT64_MAX - raw) - 1;
}

static inline int32_t rp_unpack_i32(rp_unpacker *from) { return (int32_t)rp_unpack_small(from, 32); }
static inline int16_t rp_unpack_i16(rp_unpacker *from) { return (int16_t)rp_unpack_small(from, 16); }

static inline float rp_unpack_f32(rp_unpacker *from) {
    const uint8_t *bytes = rp_unpack_raw(from, 4);
    uint32_t bits = 0;
    float value;
    int at;
    for (at = 0; at < 4 && bytes != NULL; at++) {
        bits |= (uint32_t)bytes[at] << (8 * at);
    }
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline double rp_unpack_f64(rp_unpacker *from) {
    const uint8_t *bytes = rp_unpack_raw(from, 8);
    uint64_t bits = 0;
    double value;
    int at;
    for (at = 0; at < 8 && bytes != NULL; at++) {
        bits |= (uint64_t)bytes[at] << (8 * at);
    }
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline rp_bytes rp_unpack_bytes(rp_unpacker *from) {
    rp_bytes value;
    uint64_t length = rp_unpack_u64(from);
    value.bytes = rp_unpack_raw(from, length);
    value.length = value.bytes == NULL ? 0 : (size_t)length;
    return value;
}

static inline rp_text rp_unpack_text(rp_unpacker *from) {
    rp_bytes bytes = rp_unpack_bytes(from);
    rp_text value;
    if (!rp_is_text(bytes.bytes, bytes.length)) {
        rp_unpack_fail(from, RP_TEXT);
        bytes.length = 0;
    }
    value.text = (const char *)bytes.bytes;
    value.length = bytes.length;
    return value;
}

static inline uint32_t rp_unpack_char(rp_unpacker *from) {
    rp_bytes bytes = rp_unpack_bytes(from);
    uint32_t value = 0;
    size_t taken = rp_first_char(bytes.bytes, bytes.length, &value);
    if (taken == 0 || taken != bytes.length) {
        rp_unpack_fail(from, RP_TEXT);
        return 0;
    }
    return value;
}

/** Which variant, of so many. */
static inline uint32_t rp_unpack_tag(rp_unpacker *from, uint32_t variants) {
    uint32_t tag = rp_unpack_u32(from);
    if (tag >= variants) {
        rp_unpack_fail(from, RP_VARIANT);
        return 0;
    }
    return tag;
}

/** How many elements a list has, each of `size` bytes here, and memory for them; null without any. */
static inline void *rp_unpack_list(rp_unpacker *from, size_t *count, size_t size, bool takes_bytes) {
    uint64_t claimed = rp_unpack_u64(from);
    uintptr_t past = (uintptr_t)from->memory % 16;
    size_t gap = past == 0 ? 0 : (size_t)(16 - past);
    void *memory;
    *count = 0;
    if (from->code != RP_OK || claimed == 0) {
        return NULL;
    }
    if (claimed > (takes_bytes ? from->left : from->empty_left)) {
        rp_unpack_fail(from, RP_LENGTH);
        return NULL;
    }
    if (from->memory == NULL || gap > from->memory_left || claimed > (from->memory_left - gap) / size) {
        rp_unpack_fail(from, RP_ROOM);
        return NULL;
    }
    if (!takes_bytes) {
        from->empty_left -= (size_t)claimed;
    }
    memory = from->memory + gap;
    *count = (size_t)claimed;
    from->memory += gap + *count * size;
    from->memory_left -= gap + *count * size;
    return memory;
}

#endif

/** Holds things. */
#define GRIPPER_CLASS "gripper"
/** Tells this interface from others; callers and servers have the same. For `rohrpost_module_call`. */
#define GRIPPER_HASH UINT32_C(0x341216c5)

/* Numbers of functions and of data. */

/** Closes until it feels this force. */
#define GRIPPER_FUNCTION_CLOSE 16
/** Opens. */
#define GRIPPER_FUNCTION_YIELD 17
/** How it holds now. */
#define GRIPPER_DATA_GRIP 1
/** Between the fingers. (at least 0 m) */
#define GRIPPER_DATA_WIDTH 2
/** Where it is. */
#define GRIPPER_DATA_ODOMETRY 3 /* a stream */

enum {
    GRIPPER_FINGER_LEFT = 0,
    GRIPPER_FINGER_RIGHT = 1
};

/** One of them. */
typedef uint32_t gripper_finger;

static inline void gripper_finger_write(rp_packer *to, const gripper_finger *value) {
    if (*value >= 2u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, *value);
}

static inline void gripper_finger_read(rp_unpacker *from, gripper_finger *value) {
    *value = rp_unpack_tag(from, 2);
}

typedef struct gripper_list_finger {
    const gripper_finger *items;
    size_t count;
} gripper_list_finger;

static inline void gripper_list_finger_write(rp_packer *to, const gripper_list_finger *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        gripper_finger_write(to, &value->items[at]);
    }
}

static inline void gripper_list_finger_read(rp_unpacker *from, gripper_list_finger *value) {
    size_t at;
    gripper_finger *items = (gripper_finger *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        gripper_finger_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct gripper_close_arguments {
    /** at most 20 N. */
    double force_n;
    gripper_list_finger fingers;
} gripper_close_arguments;

static inline void gripper_close_arguments_write(rp_packer *to, const gripper_close_arguments *value) {
    rp_pack_f64(to, value->force_n);
    gripper_list_finger_write(to, &value->fingers);
}

static inline void gripper_close_arguments_read(rp_unpacker *from, gripper_close_arguments *value) {
    value->force_n = rp_unpack_f64(from);
    gripper_list_finger_read(from, &value->fingers);
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code gripper_close_arguments_encode(const gripper_close_arguments *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    gripper_close_arguments_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code gripper_close_arguments_decode(gripper_close_arguments *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    gripper_close_arguments_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

/** A force. */
typedef struct gripper_newtons {
    /** 0..=20 N. */
    double v0;
} gripper_newtons;

static inline void gripper_newtons_write(rp_packer *to, const gripper_newtons *value) {
    rp_pack_f64(to, value->v0);
}

static inline void gripper_newtons_read(rp_unpacker *from, gripper_newtons *value) {
    value->v0 = rp_unpack_f64(from);
}

typedef struct gripper_option_finger {
    bool is_some;
    gripper_finger some;
} gripper_option_finger;

static inline void gripper_option_finger_write(rp_packer *to, const gripper_option_finger *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        gripper_finger_write(to, &value->some);
    }
}

static inline void gripper_option_finger_read(rp_unpacker *from, gripper_option_finger *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        gripper_finger_read(from, &value->some);
    }
}

typedef struct gripper_tuple {
    float v0;
    float v1;
} gripper_tuple;

static inline void gripper_tuple_write(rp_packer *to, const gripper_tuple *value) {
    rp_pack_f32(to, value->v0);
    rp_pack_f32(to, value->v1);
}

static inline void gripper_tuple_read(rp_unpacker *from, gripper_tuple *value) {
    value->v0 = rp_unpack_f32(from);
    value->v1 = rp_unpack_f32(from);
}

typedef struct gripper_list_tuple {
    const gripper_tuple *items;
    size_t count;
} gripper_list_tuple;

static inline void gripper_list_tuple_write(rp_packer *to, const gripper_list_tuple *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        gripper_tuple_write(to, &value->items[at]);
    }
}

static inline void gripper_list_tuple_read(rp_unpacker *from, gripper_list_tuple *value) {
    size_t at;
    gripper_tuple *items = (gripper_tuple *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        gripper_tuple_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct gripper_entry {
    uint8_t key;
    gripper_list_tuple value;
} gripper_entry;

static inline void gripper_entry_write(rp_packer *to, const gripper_entry *value) {
    rp_pack_u8(to, value->key);
    gripper_list_tuple_write(to, &value->value);
}

static inline void gripper_entry_read(rp_unpacker *from, gripper_entry *value) {
    value->key = rp_unpack_u8(from);
    gripper_list_tuple_read(from, &value->value);
}

typedef struct gripper_list_entry {
    const gripper_entry *items;
    size_t count;
} gripper_list_entry;

static inline void gripper_list_entry_write(rp_packer *to, const gripper_list_entry *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        gripper_entry_write(to, &value->items[at]);
    }
}

static inline void gripper_list_entry_read(rp_unpacker *from, gripper_list_entry *value) {
    size_t at;
    gripper_entry *items = (gripper_entry *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        gripper_entry_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct gripper_option_u8 {
    bool is_some;
    uint8_t some;
} gripper_option_u8;

static inline void gripper_option_u8_write(rp_packer *to, const gripper_option_u8 *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        rp_pack_u8(to, value->some);
    }
}

static inline void gripper_option_u8_read(rp_unpacker *from, gripper_option_u8 *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        value->some = rp_unpack_u8(from);
    }
}

typedef struct gripper_option_option_u8 {
    bool is_some;
    gripper_option_u8 some;
} gripper_option_option_u8;

static inline void gripper_option_option_u8_write(rp_packer *to, const gripper_option_option_u8 *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        gripper_option_u8_write(to, &value->some);
    }
}

static inline void gripper_option_option_u8_read(rp_unpacker *from, gripper_option_option_u8 *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        gripper_option_u8_read(from, &value->some);
    }
}

/** How it holds. """ * / / it */
typedef struct gripper_grip {
    /** Between the fingers. (m) */
    double width_m;
    gripper_newtons force;
    gripper_option_finger from;
    gripper_list_entry places;
    rp_bytes blob;
    gripper_option_option_u8 again;
} gripper_grip;

static inline void gripper_grip_write(rp_packer *to, const gripper_grip *value) {
    rp_pack_f64(to, value->width_m);
    gripper_newtons_write(to, &value->force);
    gripper_option_finger_write(to, &value->from);
    gripper_list_entry_write(to, &value->places);
    rp_pack_bytes(to, value->blob);
    gripper_option_option_u8_write(to, &value->again);
}

static inline void gripper_grip_read(rp_unpacker *from, gripper_grip *value) {
    value->width_m = rp_unpack_f64(from);
    gripper_newtons_read(from, &value->force);
    gripper_option_finger_read(from, &value->from);
    gripper_list_entry_read(from, &value->places);
    value->blob = rp_unpack_bytes(from);
    gripper_option_option_u8_read(from, &value->again);
}

typedef struct gripper_grip_error_at {
    int64_t v0;
    rp_text v1;
} gripper_grip_error_at;

static inline void gripper_grip_error_at_write(rp_packer *to, const gripper_grip_error_at *value) {
    rp_pack_i64(to, value->v0);
    rp_pack_text(to, value->v1);
}

static inline void gripper_grip_error_at_read(rp_unpacker *from, gripper_grip_error_at *value) {
    value->v0 = rp_unpack_i64(from);
    value->v1 = rp_unpack_text(from);
}

enum {
    GRIPPER_GRIP_ERROR_NONE = 0,
    GRIPPER_GRIP_ERROR_TOO_STRONG = 1,
    GRIPPER_GRIP_ERROR_AT = 2
};

/** Why it does not hold. */
typedef struct gripper_grip_error {
    uint32_t tag;
    union {
        gripper_newtons too_strong; /* GRIPPER_GRIP_ERROR_TOO_STRONG */
        gripper_grip_error_at at; /* GRIPPER_GRIP_ERROR_AT */
    } as;
} gripper_grip_error;

static inline void gripper_grip_error_write(rp_packer *to, const gripper_grip_error *value) {
    if (value->tag >= 3u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, value->tag);
    switch (value->tag) {
    case GRIPPER_GRIP_ERROR_TOO_STRONG:
        gripper_newtons_write(to, &value->as.too_strong);
        break;
    case GRIPPER_GRIP_ERROR_AT:
        gripper_grip_error_at_write(to, &value->as.at);
        break;
    default:
        break;
    }
}

static inline void gripper_grip_error_read(rp_unpacker *from, gripper_grip_error *value) {
    memset(value, 0, sizeof *value);
    value->tag = rp_unpack_tag(from, 3);
    if (from->code != RP_OK) {
        return;
    }
    switch (value->tag) {
    case GRIPPER_GRIP_ERROR_TOO_STRONG:
        gripper_newtons_read(from, &value->as.too_strong);
        break;
    case GRIPPER_GRIP_ERROR_AT:
        gripper_grip_error_at_read(from, &value->as.at);
        break;
    default:
        break;
    }
}

enum {
    GRIPPER_CLOSE_RESULT_OK = 0,
    GRIPPER_CLOSE_RESULT_ERROR = 1
};

typedef struct gripper_close_result {
    uint32_t tag;
    union {
        gripper_grip ok; /* GRIPPER_CLOSE_RESULT_OK */
        gripper_grip_error error; /* GRIPPER_CLOSE_RESULT_ERROR */
    } as;
} gripper_close_result;

static inline void gripper_close_result_write(rp_packer *to, const gripper_close_result *value) {
    if (value->tag >= 2u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, value->tag);
    switch (value->tag) {
    case GRIPPER_CLOSE_RESULT_OK:
        gripper_grip_write(to, &value->as.ok);
        break;
    case GRIPPER_CLOSE_RESULT_ERROR:
        gripper_grip_error_write(to, &value->as.error);
        break;
    default:
        break;
    }
}

static inline void gripper_close_result_read(rp_unpacker *from, gripper_close_result *value) {
    memset(value, 0, sizeof *value);
    value->tag = rp_unpack_tag(from, 2);
    if (from->code != RP_OK) {
        return;
    }
    switch (value->tag) {
    case GRIPPER_CLOSE_RESULT_OK:
        gripper_grip_read(from, &value->as.ok);
        break;
    case GRIPPER_CLOSE_RESULT_ERROR:
        gripper_grip_error_read(from, &value->as.error);
        break;
    default:
        break;
    }
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code gripper_close_result_encode(const gripper_close_result *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    gripper_close_result_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code gripper_close_result_decode(gripper_close_result *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    gripper_close_result_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

typedef gripper_grip gripper_data_grip;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code gripper_data_grip_encode(const gripper_grip *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    gripper_grip_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code gripper_data_grip_decode(gripper_grip *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    gripper_grip_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

typedef double gripper_data_width;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code gripper_data_width_encode(const double *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    rp_pack_f64(to, *value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code gripper_data_width_decode(double *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    *value = rp_unpack_f64(from);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

/** A place and a heading in the plane. */
typedef struct gripper_pose {
    /** Metres along x. (m) */
    double x_m;
    /** Metres along y. (m) */
    double y_m;
    /** Radians, counter-clockwise from x; any multiple of a turn may be added. (rad) */
    double heading_rad;
} gripper_pose;

static inline void gripper_pose_write(rp_packer *to, const gripper_pose *value) {
    rp_pack_f64(to, value->x_m);
    rp_pack_f64(to, value->y_m);
    rp_pack_f64(to, value->heading_rad);
}

static inline void gripper_pose_read(rp_unpacker *from, gripper_pose *value) {
    value->x_m = rp_unpack_f64(from);
    value->y_m = rp_unpack_f64(from);
    value->heading_rad = rp_unpack_f64(from);
}

/** How fast a body moves in its own frame. */
typedef struct gripper_twist {
    /** Metres a second, forward. (m/s) */
    double speed_m_s;
    /** Radians a second, counter-clockwise. (rad/s) */
    double turn_rate_rad_s;
} gripper_twist;

static inline void gripper_twist_write(rp_packer *to, const gripper_twist *value) {
    rp_pack_f64(to, value->speed_m_s);
    rp_pack_f64(to, value->turn_rate_rad_s);
}

static inline void gripper_twist_read(rp_unpacker *from, gripper_twist *value) {
    value->speed_m_s = rp_unpack_f64(from);
    value->turn_rate_rad_s = rp_unpack_f64(from);
}

/** What a base says of its own motion: counted from where it started, and drifting. */
typedef struct gripper_odometry {
    /** Where the base believes to be, in the frame in which it started. */
    gripper_pose pose;
    /** How it moves now. */
    gripper_twist twist;
} gripper_odometry;

static inline void gripper_odometry_write(rp_packer *to, const gripper_odometry *value) {
    gripper_pose_write(to, &value->pose);
    gripper_twist_write(to, &value->twist);
}

static inline void gripper_odometry_read(rp_unpacker *from, gripper_odometry *value) {
    gripper_pose_read(from, &value->pose);
    gripper_twist_read(from, &value->twist);
}

typedef gripper_odometry gripper_data_odometry;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code gripper_data_odometry_encode(const gripper_odometry *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    gripper_odometry_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code gripper_data_odometry_decode(gripper_odometry *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    gripper_odometry_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}


/** The interface as a module answers `describe` with it: 1332 bytes. */
static const uint8_t gripper_description[1332] = {
    2, 7, 71, 114, 105, 112, 112, 101, 114, 7, 103, 114, 105, 112, 112, 101, 114, 13, 72, 111,
    108, 100, 115, 32, 116, 104, 105, 110, 103, 115, 46, 2, 16, 5, 99, 108, 111, 115, 101, 33,
    67, 108, 111, 115, 101, 115, 32, 117, 110, 116, 105, 108, 32, 105, 116, 32, 102, 101, 101, 108,
    115, 32, 116, 104, 105, 115, 32, 102, 111, 114, 99, 101, 46, 0, 2, 7, 102, 111, 114, 99,
    101, 95, 110, 10, 1, 78, 8, 0, 0, 0, 0, 0, 0, 52, 64, 13, 7, 102, 105, 110,
    103, 101, 114, 115, 0, 18, 23, 6, 70, 105, 110, 103, 101, 114, 12, 79, 110, 101, 32, 111,
    102, 32, 116, 104, 101, 109, 46, 2, 4, 76, 101, 102, 116, 0, 0, 5, 82, 105, 103, 104,
    116, 0, 0, 23, 6, 82, 101, 115, 117, 108, 116, 0, 2, 2, 79, 107, 0, 1, 0, 0,
    22, 9, 116, 101, 115, 116, 46, 71, 114, 105, 112, 25, 72, 111, 119, 32, 105, 116, 32, 104,
    111, 108, 100, 115, 46, 32, 34, 34, 34, 32, 42, 47, 32, 92, 32, 105, 116, 3, 6, 7,
    119, 105, 100, 116, 104, 95, 109, 3, 20, 66, 101, 116, 119, 101, 101, 110, 32, 116, 104, 101,
    32, 102, 105, 110, 103, 101, 114, 115, 46, 1, 109, 13, 5, 102, 111, 114, 99, 101, 0, 22,
    7, 78, 101, 119, 116, 111, 110, 115, 8, 65, 32, 102, 111, 114, 99, 101, 46, 1, 0, 14,
    1, 78, 8, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 52, 64,
    13, 4, 102, 114, 111, 109, 0, 17, 23, 6, 70, 105, 110, 103, 101, 114, 12, 79, 110, 101,
    32, 111, 102, 32, 116, 104, 101, 109, 46, 2, 4, 76, 101, 102, 116, 0, 0, 5, 82, 105,
    103, 104, 116, 0, 0, 6, 112, 108, 97, 99, 101, 115, 0, 20, 2, 18, 21, 2, 12, 12,
    4, 98, 108, 111, 98, 0, 16, 5, 97, 103, 97, 105, 110, 0, 17, 17, 2, 3, 69, 114,
    114, 0, 1, 0, 0, 23, 9, 71, 114, 105, 112, 69, 114, 114, 111, 114, 21, 87, 104, 121,
    32, 105, 116, 32, 100, 111, 101, 115, 32, 110, 111, 116, 32, 104, 111, 108, 100, 46, 3, 4,
    78, 111, 110, 101, 0, 0, 9, 84, 111, 111, 83, 116, 114, 111, 110, 103, 0, 1, 0, 0,
    22, 7, 78, 101, 119, 116, 111, 110, 115, 8, 65, 32, 102, 111, 114, 99, 101, 46, 1, 0,
    14, 1, 78, 8, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 52,
    64, 13, 2, 97, 116, 0, 2, 2, 0, 0, 10, 0, 0, 15, 17, 5, 121, 105, 101, 108,
    100, 6, 79, 112, 101, 110, 115, 46, 1, 0, 0, 3, 1, 0, 4, 103, 114, 105, 112, 1,
    17, 72, 111, 119, 32, 105, 116, 32, 104, 111, 108, 100, 115, 32, 110, 111, 119, 46, 22, 9,
    116, 101, 115, 116, 46, 71, 114, 105, 112, 25, 72, 111, 119, 32, 105, 116, 32, 104, 111, 108,
    100, 115, 46, 32, 34, 34, 34, 32, 42, 47, 32, 92, 32, 105, 116, 3, 6, 7, 119, 105,
    100, 116, 104, 95, 109, 3, 20, 66, 101, 116, 119, 101, 101, 110, 32, 116, 104, 101, 32, 102,
    105, 110, 103, 101, 114, 115, 46, 1, 109, 13, 5, 102, 111, 114, 99, 101, 0, 22, 7, 78,
    101, 119, 116, 111, 110, 115, 8, 65, 32, 102, 111, 114, 99, 101, 46, 1, 0, 14, 1, 78,
    8, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 52, 64, 13, 4,
    102, 114, 111, 109, 0, 17, 23, 6, 70, 105, 110, 103, 101, 114, 12, 79, 110, 101, 32, 111,
    102, 32, 116, 104, 101, 109, 46, 2, 4, 76, 101, 102, 116, 0, 0, 5, 82, 105, 103, 104,
    116, 0, 0, 6, 112, 108, 97, 99, 101, 115, 0, 20, 2, 18, 21, 2, 12, 12, 4, 98,
    108, 111, 98, 0, 16, 5, 97, 103, 97, 105, 110, 0, 17, 17, 2, 2, 0, 5, 119, 105,
    100, 116, 104, 7, 20, 66, 101, 116, 119, 101, 101, 110, 32, 116, 104, 101, 32, 102, 105, 110,
    103, 101, 114, 115, 46, 1, 109, 8, 0, 0, 0, 0, 0, 0, 0, 0, 13, 3, 1, 8,
    111, 100, 111, 109, 101, 116, 114, 121, 1, 12, 87, 104, 101, 114, 101, 32, 105, 116, 32, 105,
    115, 46, 22, 17, 114, 111, 104, 114, 112, 111, 115, 116, 46, 79, 100, 111, 109, 101, 116, 114,
    121, 80, 87, 104, 97, 116, 32, 97, 32, 98, 97, 115, 101, 32, 115, 97, 121, 115, 32, 111,
    102, 32, 105, 116, 115, 32, 111, 119, 110, 32, 109, 111, 116, 105, 111, 110, 58, 32, 99, 111,
    117, 110, 116, 101, 100, 32, 102, 114, 111, 109, 32, 119, 104, 101, 114, 101, 32, 105, 116, 32,
    115, 116, 97, 114, 116, 101, 100, 44, 32, 97, 110, 100, 32, 100, 114, 105, 102, 116, 105, 110,
    103, 46, 3, 2, 4, 112, 111, 115, 101, 1, 64, 87, 104, 101, 114, 101, 32, 116, 104, 101,
    32, 98, 97, 115, 101, 32, 98, 101, 108, 105, 101, 118, 101, 115, 32, 116, 111, 32, 98, 101,
    44, 32, 105, 110, 32, 116, 104, 101, 32, 102, 114, 97, 109, 101, 32, 105, 110, 32, 119, 104,
    105, 99, 104, 32, 105, 116, 32, 115, 116, 97, 114, 116, 101, 100, 46, 22, 13, 114, 111, 104,
    114, 112, 111, 115, 116, 46, 80, 111, 115, 101, 35, 65, 32, 112, 108, 97, 99, 101, 32, 97,
    110, 100, 32, 97, 32, 104, 101, 97, 100, 105, 110, 103, 32, 105, 110, 32, 116, 104, 101, 32,
    112, 108, 97, 110, 101, 46, 3, 3, 3, 120, 95, 109, 3, 15, 77, 101, 116, 114, 101, 115,
    32, 97, 108, 111, 110, 103, 32, 120, 46, 1, 109, 13, 3, 121, 95, 109, 3, 15, 77, 101,
    116, 114, 101, 115, 32, 97, 108, 111, 110, 103, 32, 121, 46, 1, 109, 13, 11, 104, 101, 97,
    100, 105, 110, 103, 95, 114, 97, 100, 3, 71, 82, 97, 100, 105, 97, 110, 115, 44, 32, 99,
    111, 117, 110, 116, 101, 114, 45, 99, 108, 111, 99, 107, 119, 105, 115, 101, 32, 102, 114, 111,
    109, 32, 120, 59, 32, 97, 110, 121, 32, 109, 117, 108, 116, 105, 112, 108, 101, 32, 111, 102,
    32, 97, 32, 116, 117, 114, 110, 32, 109, 97, 121, 32, 98, 101, 32, 97, 100, 100, 101, 100,
    46, 3, 114, 97, 100, 13, 5, 116, 119, 105, 115, 116, 1, 17, 72, 111, 119, 32, 105, 116,
    32, 109, 111, 118, 101, 115, 32, 110, 111, 119, 46, 22, 14, 114, 111, 104, 114, 112, 111, 115,
    116, 46, 84, 119, 105, 115, 116, 39, 72, 111, 119, 32, 102, 97, 115, 116, 32, 97, 32, 98,
    111, 100, 121, 32, 109, 111, 118, 101, 115, 32, 105, 110, 32, 105, 116, 115, 32, 111, 119, 110,
    32, 102, 114, 97, 109, 101, 46, 3, 2, 9, 115, 112, 101, 101, 100, 95, 109, 95, 115, 3,
    25, 77, 101, 116, 114, 101, 115, 32, 97, 32, 115, 101, 99, 111, 110, 100, 44, 32, 102, 111,
    114, 119, 97, 114, 100, 46, 3, 109, 47, 115, 13, 15, 116, 117, 114, 110, 95, 114, 97, 116,
    101, 95, 114, 97, 100, 95, 115, 3, 36, 82, 97, 100, 105, 97, 110, 115, 32, 97, 32, 115,
    101, 99, 111, 110, 100, 44, 32, 99, 111, 117, 110, 116, 101, 114, 45, 99, 108, 111, 99, 107,
    119, 105, 115, 101, 46, 5, 114, 97, 100, 47, 115, 13,
};

#endif
