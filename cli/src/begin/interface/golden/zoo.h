/* Interface Zoo of class zoo.
 *
 * Made by `rohrpost interface generate --lang c`: do not change it here, but where it was written, and make this anew.
 * C11 or C++17. Reading: `…_decode` with memory for elements of lists; texts and bytes stay in the buffer. Writing:
 * `…_encode` into a buffer; its length is told also when there is no room. */
#ifndef ROHRPOST_ZOO_2CAF1AA6
#define ROHRPOST_ZOO_2CAF1AA6

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

/** All kinds of types, and of names. */
#define ZOO_CLASS "zoo"
/** Tells this interface from others; callers and servers have the same. For `rohrpost_module_call`. */
#define ZOO_HASH UINT32_C(0x2caf1aa6)

/* Numbers of functions and of data. */

/** Feeds one. */
#define ZOO_FUNCTION_FEED 16
#define ZOO_FUNCTION_CONTINUE 17
#define ZOO_FUNCTION_PUBLISH 18
/** Two errors have one name. */
#define ZOO_FUNCTION_CLEAN 300
/** All animals. */
#define ZOO_DATA_ANIMALS 1
/** Where it is. */
#define ZOO_DATA_ODOMETRY 3 /* a stream */
/** at least -3.2 rad. */
#define ZOO_DATA_TYPE 16384

typedef struct zoo_option_u8 {
    bool is_some;
    uint8_t some;
} zoo_option_u8;

static inline void zoo_option_u8_write(rp_packer *to, const zoo_option_u8 *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        rp_pack_u8(to, value->some);
    }
}

static inline void zoo_option_u8_read(rp_unpacker *from, zoo_option_u8 *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        value->some = rp_unpack_u8(from);
    }
}

typedef struct zoo_order_turn {
    int32_t v0;
    bool v1;
} zoo_order_turn;

static inline void zoo_order_turn_write(rp_packer *to, const zoo_order_turn *value) {
    rp_pack_i32(to, value->v0);
    rp_pack_bool(to, value->v1);
}

static inline void zoo_order_turn_read(rp_unpacker *from, zoo_order_turn *value) {
    value->v0 = rp_unpack_i32(from);
    value->v1 = rp_unpack_bool(from);
}

enum {
    /** Dark. */
    ZOO_LAMP_OFF = 0,
    ZOO_LAMP_ON_FULL = 1,
    ZOO_LAMP_NONE = 2
};

/** Whether it shines. "Quoted" * / text """ with / signs. */
typedef uint32_t zoo_lamp;

static inline void zoo_lamp_write(rp_packer *to, const zoo_lamp *value) {
    if (*value >= 3u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, *value);
}

static inline void zoo_lamp_read(rp_unpacker *from, zoo_lamp *value) {
    *value = rp_unpack_tag(from, 3);
}

typedef struct zoo_option_lamp {
    bool is_some;
    zoo_lamp some;
} zoo_option_lamp;

static inline void zoo_option_lamp_write(rp_packer *to, const zoo_option_lamp *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        zoo_lamp_write(to, &value->some);
    }
}

static inline void zoo_option_lamp_read(rp_unpacker *from, zoo_option_lamp *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        zoo_lamp_read(from, &value->some);
    }
}

typedef struct zoo_order_drive {
    /** Forward. (0..=1.5 m/s) */
    double speed_m_s;
    zoo_option_lamp until;
} zoo_order_drive;

static inline void zoo_order_drive_write(rp_packer *to, const zoo_order_drive *value) {
    rp_pack_f64(to, value->speed_m_s);
    zoo_option_lamp_write(to, &value->until);
}

static inline void zoo_order_drive_read(rp_unpacker *from, zoo_order_drive *value) {
    value->speed_m_s = rp_unpack_f64(from);
    zoo_option_lamp_read(from, &value->until);
}

enum {
    ZOO_ORDER_STOP = 0,
    /** How fast. */
    ZOO_ORDER_GO = 1,
    ZOO_ORDER_HOLD = 2,
    ZOO_ORDER_TURN = 3,
    ZOO_ORDER_DRIVE = 4
};

/** What to do. */
typedef struct zoo_order {
    uint32_t tag;
    union {
        double go; /* ZOO_ORDER_GO */
        zoo_option_u8 hold; /* ZOO_ORDER_HOLD */
        zoo_order_turn turn; /* ZOO_ORDER_TURN */
        zoo_order_drive drive; /* ZOO_ORDER_DRIVE */
    } as;
} zoo_order;

static inline void zoo_order_write(rp_packer *to, const zoo_order *value) {
    if (value->tag >= 5u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, value->tag);
    switch (value->tag) {
    case ZOO_ORDER_GO:
        rp_pack_f64(to, value->as.go);
        break;
    case ZOO_ORDER_HOLD:
        zoo_option_u8_write(to, &value->as.hold);
        break;
    case ZOO_ORDER_TURN:
        zoo_order_turn_write(to, &value->as.turn);
        break;
    case ZOO_ORDER_DRIVE:
        zoo_order_drive_write(to, &value->as.drive);
        break;
    default:
        break;
    }
}

static inline void zoo_order_read(rp_unpacker *from, zoo_order *value) {
    memset(value, 0, sizeof *value);
    value->tag = rp_unpack_tag(from, 5);
    if (from->code != RP_OK) {
        return;
    }
    switch (value->tag) {
    case ZOO_ORDER_GO:
        value->as.go = rp_unpack_f64(from);
        break;
    case ZOO_ORDER_HOLD:
        zoo_option_u8_read(from, &value->as.hold);
        break;
    case ZOO_ORDER_TURN:
        zoo_order_turn_read(from, &value->as.turn);
        break;
    case ZOO_ORDER_DRIVE:
        zoo_order_drive_read(from, &value->as.drive);
        break;
    default:
        break;
    }
}

typedef struct zoo_feed_arguments {
    /** 0..=20.5 kg. */
    double from;
    /** at least 1. */
    uint8_t count;
    zoo_order order;
} zoo_feed_arguments;

static inline void zoo_feed_arguments_write(rp_packer *to, const zoo_feed_arguments *value) {
    rp_pack_f64(to, value->from);
    rp_pack_u8(to, value->count);
    zoo_order_write(to, &value->order);
}

static inline void zoo_feed_arguments_read(rp_unpacker *from, zoo_feed_arguments *value) {
    value->from = rp_unpack_f64(from);
    value->count = rp_unpack_u8(from);
    zoo_order_read(from, &value->order);
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_feed_arguments_encode(const zoo_feed_arguments *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_feed_arguments_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_feed_arguments_decode(zoo_feed_arguments *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_feed_arguments_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

/** A length. */
typedef struct zoo_meters {
    /** -1..=1000000000 m. */
    float v0;
} zoo_meters;

static inline void zoo_meters_write(rp_packer *to, const zoo_meters *value) {
    rp_pack_f32(to, value->v0);
}

static inline void zoo_meters_read(rp_unpacker *from, zoo_meters *value) {
    value->v0 = rp_unpack_f32(from);
}

enum {
    ZOO_FEED_RESULT_OK = 0,
    ZOO_FEED_RESULT_ERROR = 1
};

typedef struct zoo_feed_result {
    uint32_t tag;
    union {
        zoo_meters ok; /* ZOO_FEED_RESULT_OK */
        zoo_lamp error; /* ZOO_FEED_RESULT_ERROR */
    } as;
} zoo_feed_result;

static inline void zoo_feed_result_write(rp_packer *to, const zoo_feed_result *value) {
    if (value->tag >= 2u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, value->tag);
    switch (value->tag) {
    case ZOO_FEED_RESULT_OK:
        zoo_meters_write(to, &value->as.ok);
        break;
    case ZOO_FEED_RESULT_ERROR:
        zoo_lamp_write(to, &value->as.error);
        break;
    default:
        break;
    }
}

static inline void zoo_feed_result_read(rp_unpacker *from, zoo_feed_result *value) {
    memset(value, 0, sizeof *value);
    value->tag = rp_unpack_tag(from, 2);
    if (from->code != RP_OK) {
        return;
    }
    switch (value->tag) {
    case ZOO_FEED_RESULT_OK:
        zoo_meters_read(from, &value->as.ok);
        break;
    case ZOO_FEED_RESULT_ERROR:
        zoo_lamp_read(from, &value->as.error);
        break;
    default:
        break;
    }
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_feed_result_encode(const zoo_feed_result *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_feed_result_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_feed_result_decode(zoo_feed_result *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_feed_result_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

typedef struct zoo_pen {
    zoo_lamp inside;
} zoo_pen;

static inline void zoo_pen_write(rp_packer *to, const zoo_pen *value) {
    zoo_lamp_write(to, &value->inside);
}

static inline void zoo_pen_read(rp_unpacker *from, zoo_pen *value) {
    zoo_lamp_read(from, &value->inside);
}

typedef struct zoo_pen_2 {
    uint8_t inside;
} zoo_pen_2;

static inline void zoo_pen_2_write(rp_packer *to, const zoo_pen_2 *value) {
    rp_pack_u8(to, value->inside);
}

static inline void zoo_pen_2_read(rp_unpacker *from, zoo_pen_2 *value) {
    value->inside = rp_unpack_u8(from);
}

typedef struct zoo_publish_arguments {
    zoo_pen lambda;
    zoo_pen_2 other;
} zoo_publish_arguments;

static inline void zoo_publish_arguments_write(rp_packer *to, const zoo_publish_arguments *value) {
    zoo_pen_write(to, &value->lambda);
    zoo_pen_2_write(to, &value->other);
}

static inline void zoo_publish_arguments_read(rp_unpacker *from, zoo_publish_arguments *value) {
    zoo_pen_read(from, &value->lambda);
    zoo_pen_2_read(from, &value->other);
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_publish_arguments_encode(const zoo_publish_arguments *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_publish_arguments_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_publish_arguments_decode(zoo_publish_arguments *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_publish_arguments_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

/** A place and a heading in the plane. */
typedef struct zoo_pose {
    /** Metres along x. (m) */
    double x_m;
    /** Metres along y. (m) */
    double y_m;
    /** Radians, counter-clockwise from x; any multiple of a turn may be added. (rad) */
    double heading_rad;
} zoo_pose;

static inline void zoo_pose_write(rp_packer *to, const zoo_pose *value) {
    rp_pack_f64(to, value->x_m);
    rp_pack_f64(to, value->y_m);
    rp_pack_f64(to, value->heading_rad);
}

static inline void zoo_pose_read(rp_unpacker *from, zoo_pose *value) {
    value->x_m = rp_unpack_f64(from);
    value->y_m = rp_unpack_f64(from);
    value->heading_rad = rp_unpack_f64(from);
}

/** How fast a body moves in its own frame. */
typedef struct zoo_twist {
    /** Metres a second, forward. (m/s) */
    double speed_m_s;
    /** Radians a second, counter-clockwise. (rad/s) */
    double turn_rate_rad_s;
} zoo_twist;

static inline void zoo_twist_write(rp_packer *to, const zoo_twist *value) {
    rp_pack_f64(to, value->speed_m_s);
    rp_pack_f64(to, value->turn_rate_rad_s);
}

static inline void zoo_twist_read(rp_unpacker *from, zoo_twist *value) {
    value->speed_m_s = rp_unpack_f64(from);
    value->turn_rate_rad_s = rp_unpack_f64(from);
}

/** What a base says of its own motion: counted from where it started, and drifting. */
typedef struct zoo_odometry {
    /** Where the base believes to be, in the frame in which it started. */
    zoo_pose pose;
    /** How it moves now. */
    zoo_twist twist;
} zoo_odometry;

static inline void zoo_odometry_write(rp_packer *to, const zoo_odometry *value) {
    zoo_pose_write(to, &value->pose);
    zoo_twist_write(to, &value->twist);
}

static inline void zoo_odometry_read(rp_unpacker *from, zoo_odometry *value) {
    zoo_pose_read(from, &value->pose);
    zoo_twist_read(from, &value->twist);
}

typedef struct zoo_option_odometry {
    bool is_some;
    zoo_odometry some;
} zoo_option_odometry;

static inline void zoo_option_odometry_write(rp_packer *to, const zoo_option_odometry *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        zoo_odometry_write(to, &value->some);
    }
}

static inline void zoo_option_odometry_read(rp_unpacker *from, zoo_option_odometry *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        zoo_odometry_read(from, &value->some);
    }
}

typedef zoo_option_odometry zoo_publish_result;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_publish_result_encode(const zoo_option_odometry *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_option_odometry_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_publish_result_decode(zoo_option_odometry *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_option_odometry_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

/** Nothing in it. */
typedef struct zoo_marker {
    rp_nothing nothing; /* takes no bytes */
} zoo_marker;

static inline void zoo_marker_write(rp_packer *to, const zoo_marker *value) {
    rp_pack_nothing(to, value->nothing);
}

static inline void zoo_marker_read(rp_unpacker *from, zoo_marker *value) {
    value->nothing = rp_unpack_nothing(from);
}

typedef struct zoo_clean_arguments {
    zoo_marker marker;
} zoo_clean_arguments;

static inline void zoo_clean_arguments_write(rp_packer *to, const zoo_clean_arguments *value) {
    zoo_marker_write(to, &value->marker);
}

static inline void zoo_clean_arguments_read(rp_unpacker *from, zoo_clean_arguments *value) {
    zoo_marker_read(from, &value->marker);
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_clean_arguments_encode(const zoo_clean_arguments *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_clean_arguments_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_clean_arguments_decode(zoo_clean_arguments *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_clean_arguments_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

enum {
    ZOO_CLEAN_RESULT_OK = 0,
    ZOO_CLEAN_RESULT_ERROR = 1
};

typedef struct zoo_clean_result {
    uint32_t tag;
    union {
        rp_nothing ok; /* ZOO_CLEAN_RESULT_OK */
        rp_text error; /* ZOO_CLEAN_RESULT_ERROR */
    } as;
} zoo_clean_result;

static inline void zoo_clean_result_write(rp_packer *to, const zoo_clean_result *value) {
    if (value->tag >= 2u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, value->tag);
    switch (value->tag) {
    case ZOO_CLEAN_RESULT_OK:
        rp_pack_nothing(to, value->as.ok);
        break;
    case ZOO_CLEAN_RESULT_ERROR:
        rp_pack_text(to, value->as.error);
        break;
    default:
        break;
    }
}

static inline void zoo_clean_result_read(rp_unpacker *from, zoo_clean_result *value) {
    memset(value, 0, sizeof *value);
    value->tag = rp_unpack_tag(from, 2);
    if (from->code != RP_OK) {
        return;
    }
    switch (value->tag) {
    case ZOO_CLEAN_RESULT_OK:
        value->as.ok = rp_unpack_nothing(from);
        break;
    case ZOO_CLEAN_RESULT_ERROR:
        value->as.error = rp_unpack_text(from);
        break;
    default:
        break;
    }
}

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_clean_result_encode(const zoo_clean_result *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_clean_result_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_clean_result_decode(zoo_clean_result *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_clean_result_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

typedef struct zoo_tuple {
    int8_t v0;
    int16_t v1;
    int32_t v2;
    int64_t v3;
    rp_i128 v4;
} zoo_tuple;

static inline void zoo_tuple_write(rp_packer *to, const zoo_tuple *value) {
    rp_pack_i8(to, value->v0);
    rp_pack_i16(to, value->v1);
    rp_pack_i32(to, value->v2);
    rp_pack_i64(to, value->v3);
    rp_pack_i128(to, value->v4);
}

static inline void zoo_tuple_read(rp_unpacker *from, zoo_tuple *value) {
    value->v0 = rp_unpack_i8(from);
    value->v1 = rp_unpack_i16(from);
    value->v2 = rp_unpack_i32(from);
    value->v3 = rp_unpack_i64(from);
    value->v4 = rp_unpack_i128(from);
}

typedef struct zoo_tuple_2 {
    uint8_t v0;
    uint16_t v1;
    uint32_t v2;
    uint64_t v3;
} zoo_tuple_2;

static inline void zoo_tuple_2_write(rp_packer *to, const zoo_tuple_2 *value) {
    rp_pack_u8(to, value->v0);
    rp_pack_u16(to, value->v1);
    rp_pack_u32(to, value->v2);
    rp_pack_u64(to, value->v3);
}

static inline void zoo_tuple_2_read(rp_unpacker *from, zoo_tuple_2 *value) {
    value->v0 = rp_unpack_u8(from);
    value->v1 = rp_unpack_u16(from);
    value->v2 = rp_unpack_u32(from);
    value->v3 = rp_unpack_u64(from);
}

typedef struct zoo_tuple_3 {
    float v0;
    double v1;
} zoo_tuple_3;

static inline void zoo_tuple_3_write(rp_packer *to, const zoo_tuple_3 *value) {
    rp_pack_f32(to, value->v0);
    rp_pack_f64(to, value->v1);
}

static inline void zoo_tuple_3_read(rp_unpacker *from, zoo_tuple_3 *value) {
    value->v0 = rp_unpack_f32(from);
    value->v1 = rp_unpack_f64(from);
}

/** Numbers of all sizes. */
typedef struct zoo_numbers {
    /** `signed`. */
    zoo_tuple signed_;
    /** `unsigned`. */
    zoo_tuple_2 unsigned_;
    rp_u128 huge;
    zoo_tuple_3 floats;
} zoo_numbers;

static inline void zoo_numbers_write(rp_packer *to, const zoo_numbers *value) {
    zoo_tuple_write(to, &value->signed_);
    zoo_tuple_2_write(to, &value->unsigned_);
    rp_pack_u128(to, value->huge);
    zoo_tuple_3_write(to, &value->floats);
}

static inline void zoo_numbers_read(rp_unpacker *from, zoo_numbers *value) {
    zoo_tuple_read(from, &value->signed_);
    zoo_tuple_2_read(from, &value->unsigned_);
    value->huge = rp_unpack_u128(from);
    zoo_tuple_3_read(from, &value->floats);
}

typedef struct zoo_array3_f64 {
    double items[3];
} zoo_array3_f64;

static inline void zoo_array3_f64_write(rp_packer *to, const zoo_array3_f64 *value) {
    size_t at;
    for (at = 0; at < 3; at++) {
        rp_pack_f64(to, value->items[at]);
    }
}

static inline void zoo_array3_f64_read(rp_unpacker *from, zoo_array3_f64 *value) {
    size_t at;
    for (at = 0; at < 3; at++) {
        value->items[at] = rp_unpack_f64(from);
    }
}

typedef struct zoo_array0_u8 {
    uint8_t items[1];
} zoo_array0_u8;

static inline void zoo_array0_u8_write(rp_packer *to, const zoo_array0_u8 *value) {
    (void)value;
    rp_pack_nothing(to, 0);
}

static inline void zoo_array0_u8_read(rp_unpacker *from, zoo_array0_u8 *value) {
    memset(value, 0, sizeof *value);
    (void)from;
}

typedef struct zoo_pair {
    /** °. */
    int16_t v0;
    uint32_t v1;
} zoo_pair;

static inline void zoo_pair_write(rp_packer *to, const zoo_pair *value) {
    rp_pack_i16(to, value->v0);
    rp_pack_char(to, value->v1);
}

static inline void zoo_pair_read(rp_unpacker *from, zoo_pair *value) {
    value->v0 = rp_unpack_i16(from);
    value->v1 = rp_unpack_char(from);
}

typedef struct zoo_option_option_u8 {
    bool is_some;
    zoo_option_u8 some;
} zoo_option_option_u8;

static inline void zoo_option_option_u8_write(rp_packer *to, const zoo_option_option_u8 *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        zoo_option_u8_write(to, &value->some);
    }
}

static inline void zoo_option_option_u8_read(rp_unpacker *from, zoo_option_option_u8 *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        zoo_option_u8_read(from, &value->some);
    }
}

typedef struct zoo_array3_option_option_u8 {
    zoo_option_option_u8 items[3];
} zoo_array3_option_option_u8;

static inline void zoo_array3_option_option_u8_write(rp_packer *to, const zoo_array3_option_option_u8 *value) {
    size_t at;
    for (at = 0; at < 3; at++) {
        zoo_option_option_u8_write(to, &value->items[at]);
    }
}

static inline void zoo_array3_option_option_u8_read(rp_unpacker *from, zoo_array3_option_option_u8 *value) {
    size_t at;
    for (at = 0; at < 3; at++) {
        zoo_option_option_u8_read(from, &value->items[at]);
    }
}

typedef struct zoo_option_nothing {
    bool is_some;
    rp_nothing some;
} zoo_option_nothing;

static inline void zoo_option_nothing_write(rp_packer *to, const zoo_option_nothing *value) {
    rp_pack_bool(to, value->is_some);
    if (value->is_some) {
        rp_pack_nothing(to, value->some);
    }
}

static inline void zoo_option_nothing_read(rp_unpacker *from, zoo_option_nothing *value) {
    memset(value, 0, sizeof *value);
    value->is_some = rp_unpack_bool(from);
    if (value->is_some) {
        value->some = rp_unpack_nothing(from);
    }
}

typedef struct zoo_array2_option_nothing {
    zoo_option_nothing items[2];
} zoo_array2_option_nothing;

static inline void zoo_array2_option_nothing_write(rp_packer *to, const zoo_array2_option_nothing *value) {
    size_t at;
    for (at = 0; at < 2; at++) {
        zoo_option_nothing_write(to, &value->items[at]);
    }
}

static inline void zoo_array2_option_nothing_read(rp_unpacker *from, zoo_array2_option_nothing *value) {
    size_t at;
    for (at = 0; at < 2; at++) {
        zoo_option_nothing_read(from, &value->items[at]);
    }
}

typedef struct zoo_list_order {
    const zoo_order *items;
    size_t count;
} zoo_list_order;

static inline void zoo_list_order_write(rp_packer *to, const zoo_list_order *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        zoo_order_write(to, &value->items[at]);
    }
}

static inline void zoo_list_order_read(rp_unpacker *from, zoo_list_order *value) {
    size_t at;
    zoo_order *items = (zoo_order *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        zoo_order_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct zoo_list_u8 {
    const uint8_t *items;
    size_t count;
} zoo_list_u8;

static inline void zoo_list_u8_write(rp_packer *to, const zoo_list_u8 *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        rp_pack_u8(to, value->items[at]);
    }
}

static inline void zoo_list_u8_read(rp_unpacker *from, zoo_list_u8 *value) {
    size_t at;
    uint8_t *items = (uint8_t *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        items[at] = rp_unpack_u8(from);
    }
    value->items = items;
}

typedef struct zoo_list_i16 {
    const int16_t *items;
    size_t count;
} zoo_list_i16;

static inline void zoo_list_i16_write(rp_packer *to, const zoo_list_i16 *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        rp_pack_i16(to, value->items[at]);
    }
}

static inline void zoo_list_i16_read(rp_unpacker *from, zoo_list_i16 *value) {
    size_t at;
    int16_t *items = (int16_t *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        items[at] = rp_unpack_i16(from);
    }
    value->items = items;
}

typedef struct zoo_list_list_i16 {
    const zoo_list_i16 *items;
    size_t count;
} zoo_list_list_i16;

static inline void zoo_list_list_i16_write(rp_packer *to, const zoo_list_list_i16 *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        zoo_list_i16_write(to, &value->items[at]);
    }
}

static inline void zoo_list_list_i16_read(rp_unpacker *from, zoo_list_list_i16 *value) {
    size_t at;
    zoo_list_i16 *items = (zoo_list_i16 *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        zoo_list_i16_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct zoo_entry {
    rp_text key;
    uint16_t value;
} zoo_entry;

static inline void zoo_entry_write(rp_packer *to, const zoo_entry *value) {
    rp_pack_text(to, value->key);
    rp_pack_u16(to, value->value);
}

static inline void zoo_entry_read(rp_unpacker *from, zoo_entry *value) {
    value->key = rp_unpack_text(from);
    value->value = rp_unpack_u16(from);
}

typedef struct zoo_list_entry {
    const zoo_entry *items;
    size_t count;
} zoo_list_entry;

static inline void zoo_list_entry_write(rp_packer *to, const zoo_list_entry *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        zoo_entry_write(to, &value->items[at]);
    }
}

static inline void zoo_list_entry_read(rp_unpacker *from, zoo_list_entry *value) {
    size_t at;
    zoo_entry *items = (zoo_entry *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        zoo_entry_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct zoo_entry_2 {
    int64_t key;
    uint32_t value;
} zoo_entry_2;

static inline void zoo_entry_2_write(rp_packer *to, const zoo_entry_2 *value) {
    rp_pack_i64(to, value->key);
    rp_pack_char(to, value->value);
}

static inline void zoo_entry_2_read(rp_unpacker *from, zoo_entry_2 *value) {
    value->key = rp_unpack_i64(from);
    value->value = rp_unpack_char(from);
}

typedef struct zoo_list_entry_2 {
    const zoo_entry_2 *items;
    size_t count;
} zoo_list_entry_2;

static inline void zoo_list_entry_2_write(rp_packer *to, const zoo_list_entry_2 *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        zoo_entry_2_write(to, &value->items[at]);
    }
}

static inline void zoo_list_entry_2_read(rp_unpacker *from, zoo_list_entry_2 *value) {
    size_t at;
    zoo_entry_2 *items = (zoo_entry_2 *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        zoo_entry_2_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct zoo_entry_3 {
    zoo_lamp key;
    bool value;
} zoo_entry_3;

static inline void zoo_entry_3_write(rp_packer *to, const zoo_entry_3 *value) {
    zoo_lamp_write(to, &value->key);
    rp_pack_bool(to, value->value);
}

static inline void zoo_entry_3_read(rp_unpacker *from, zoo_entry_3 *value) {
    zoo_lamp_read(from, &value->key);
    value->value = rp_unpack_bool(from);
}

typedef struct zoo_list_entry_3 {
    const zoo_entry_3 *items;
    size_t count;
} zoo_list_entry_3;

static inline void zoo_list_entry_3_write(rp_packer *to, const zoo_list_entry_3 *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        zoo_entry_3_write(to, &value->items[at]);
    }
}

static inline void zoo_list_entry_3_read(rp_unpacker *from, zoo_list_entry_3 *value) {
    size_t at;
    zoo_entry_3 *items = (zoo_entry_3 *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        zoo_entry_3_read(from, &items[at]);
    }
    value->items = items;
}

typedef struct zoo_tuple_4 {
    int8_t v0;
    int8_t v1;
} zoo_tuple_4;

static inline void zoo_tuple_4_write(rp_packer *to, const zoo_tuple_4 *value) {
    rp_pack_i8(to, value->v0);
    rp_pack_i8(to, value->v1);
}

static inline void zoo_tuple_4_read(rp_unpacker *from, zoo_tuple_4 *value) {
    value->v0 = rp_unpack_i8(from);
    value->v1 = rp_unpack_i8(from);
}

typedef struct zoo_entry_4 {
    zoo_tuple_4 key;
    float value;
} zoo_entry_4;

static inline void zoo_entry_4_write(rp_packer *to, const zoo_entry_4 *value) {
    zoo_tuple_4_write(to, &value->key);
    rp_pack_f32(to, value->value);
}

static inline void zoo_entry_4_read(rp_unpacker *from, zoo_entry_4 *value) {
    zoo_tuple_4_read(from, &value->key);
    value->value = rp_unpack_f32(from);
}

typedef struct zoo_list_entry_4 {
    const zoo_entry_4 *items;
    size_t count;
} zoo_list_entry_4;

static inline void zoo_list_entry_4_write(rp_packer *to, const zoo_list_entry_4 *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        zoo_entry_4_write(to, &value->items[at]);
    }
}

static inline void zoo_list_entry_4_read(rp_unpacker *from, zoo_list_entry_4 *value) {
    size_t at;
    zoo_entry_4 *items = (zoo_entry_4 *)rp_unpack_list(from, &value->count, sizeof *items, true);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        zoo_entry_4_read(from, &items[at]);
    }
    value->items = items;
}

enum {
    ZOO_RESULT_OK = 0,
    ZOO_RESULT_ERR = 1
};

typedef struct zoo_result {
    uint32_t tag;
    union {
        uint8_t ok; /* ZOO_RESULT_OK */
        rp_text err; /* ZOO_RESULT_ERR */
    } as;
} zoo_result;

static inline void zoo_result_write(rp_packer *to, const zoo_result *value) {
    if (value->tag >= 2u) {
        rp_pack_fail(to, RP_VARIANT);
        return;
    }
    rp_pack_u32(to, value->tag);
    switch (value->tag) {
    case ZOO_RESULT_OK:
        rp_pack_u8(to, value->as.ok);
        break;
    case ZOO_RESULT_ERR:
        rp_pack_text(to, value->as.err);
        break;
    default:
        break;
    }
}

static inline void zoo_result_read(rp_unpacker *from, zoo_result *value) {
    memset(value, 0, sizeof *value);
    value->tag = rp_unpack_tag(from, 2);
    if (from->code != RP_OK) {
        return;
    }
    switch (value->tag) {
    case ZOO_RESULT_OK:
        value->as.ok = rp_unpack_u8(from);
        break;
    case ZOO_RESULT_ERR:
        value->as.err = rp_unpack_text(from);
        break;
    default:
        break;
    }
}

typedef struct zoo_list_nothing {
    const rp_nothing *items;
    size_t count;
} zoo_list_nothing;

static inline void zoo_list_nothing_write(rp_packer *to, const zoo_list_nothing *value) {
    size_t at;
    rp_pack_u64(to, value->count);
    for (at = 0; at < value->count; at++) {
        rp_pack_nothing(to, value->items[at]);
    }
}

static inline void zoo_list_nothing_read(rp_unpacker *from, zoo_list_nothing *value) {
    size_t at;
    rp_nothing *items = (rp_nothing *)rp_unpack_list(from, &value->count, sizeof *items, false);
    for (at = 0; at < value->count && from->code == RP_OK; at++) {
        items[at] = rp_unpack_nothing(from);
    }
    value->items = items;
}

typedef struct zoo_zoo {
    zoo_numbers numbers;
    zoo_array3_f64 small;
    zoo_array0_u8 no_room;
    bool flag;
    uint32_t letter;
    rp_text name;
    rp_nothing nothing;
    zoo_meters distance;
    zoo_pair pair;
    zoo_option_u8 maybe;
    zoo_array3_option_option_u8 nested;
    zoo_array2_option_nothing some_nothing;
    zoo_list_order orders;
    zoo_list_u8 bytes;
    rp_bytes blob;
    zoo_list_list_i16 lists;
    zoo_list_entry by_name;
    zoo_list_entry_2 by_number;
    zoo_list_entry_3 by_lamp;
    zoo_list_entry_4 by_place;
    zoo_result result;
    zoo_list_nothing units;
    /** `class`. The same word in Python, Rust and C++. */
    uint8_t class_;
    int8_t from;
    uint8_t type;
    /** `Odd name!`. */
    uint8_t odd_name;
    /** `odd_name`. */
    uint8_t odd_name_2;
} zoo_zoo;

static inline void zoo_zoo_write(rp_packer *to, const zoo_zoo *value) {
    zoo_numbers_write(to, &value->numbers);
    zoo_array3_f64_write(to, &value->small);
    zoo_array0_u8_write(to, &value->no_room);
    rp_pack_bool(to, value->flag);
    rp_pack_char(to, value->letter);
    rp_pack_text(to, value->name);
    rp_pack_nothing(to, value->nothing);
    zoo_meters_write(to, &value->distance);
    zoo_pair_write(to, &value->pair);
    zoo_option_u8_write(to, &value->maybe);
    zoo_array3_option_option_u8_write(to, &value->nested);
    zoo_array2_option_nothing_write(to, &value->some_nothing);
    zoo_list_order_write(to, &value->orders);
    zoo_list_u8_write(to, &value->bytes);
    rp_pack_bytes(to, value->blob);
    zoo_list_list_i16_write(to, &value->lists);
    zoo_list_entry_write(to, &value->by_name);
    zoo_list_entry_2_write(to, &value->by_number);
    zoo_list_entry_3_write(to, &value->by_lamp);
    zoo_list_entry_4_write(to, &value->by_place);
    zoo_result_write(to, &value->result);
    zoo_list_nothing_write(to, &value->units);
    rp_pack_u8(to, value->class_);
    rp_pack_i8(to, value->from);
    rp_pack_u8(to, value->type);
    rp_pack_u8(to, value->odd_name);
    rp_pack_u8(to, value->odd_name_2);
}

static inline void zoo_zoo_read(rp_unpacker *from, zoo_zoo *value) {
    zoo_numbers_read(from, &value->numbers);
    zoo_array3_f64_read(from, &value->small);
    zoo_array0_u8_read(from, &value->no_room);
    value->flag = rp_unpack_bool(from);
    value->letter = rp_unpack_char(from);
    value->name = rp_unpack_text(from);
    value->nothing = rp_unpack_nothing(from);
    zoo_meters_read(from, &value->distance);
    zoo_pair_read(from, &value->pair);
    zoo_option_u8_read(from, &value->maybe);
    zoo_array3_option_option_u8_read(from, &value->nested);
    zoo_array2_option_nothing_read(from, &value->some_nothing);
    zoo_list_order_read(from, &value->orders);
    zoo_list_u8_read(from, &value->bytes);
    value->blob = rp_unpack_bytes(from);
    zoo_list_list_i16_read(from, &value->lists);
    zoo_list_entry_read(from, &value->by_name);
    zoo_list_entry_2_read(from, &value->by_number);
    zoo_list_entry_3_read(from, &value->by_lamp);
    zoo_list_entry_4_read(from, &value->by_place);
    zoo_result_read(from, &value->result);
    zoo_list_nothing_read(from, &value->units);
    value->class_ = rp_unpack_u8(from);
    value->from = rp_unpack_i8(from);
    value->type = rp_unpack_u8(from);
    value->odd_name = rp_unpack_u8(from);
    value->odd_name_2 = rp_unpack_u8(from);
}

typedef zoo_zoo zoo_data_animals;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_data_animals_encode(const zoo_zoo *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_zoo_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_data_animals_decode(zoo_zoo *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_zoo_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

typedef zoo_odometry zoo_data_odometry;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_data_odometry_encode(const zoo_odometry *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    zoo_odometry_write(to, value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_data_odometry_decode(zoo_odometry *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    zoo_odometry_read(from, value);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}

typedef float zoo_data_type;

/** Writes it; `used` is how long it is, also when there is no room. */
static inline rp_code zoo_data_type_encode(const float *value, uint8_t *bytes, size_t room, size_t *used) {
    rp_packer packer = {bytes, room, 0, RP_OK};
    rp_packer *to = &packer;
    rp_pack_f32(to, *value);
    *used = packer.used;
    return packer.code;
}

/** Reads all of the bytes; texts and bytes stay there, elements of lists go to `memory`, which may be null. On an
 * error nothing in the value is to be used. */
static inline rp_code zoo_data_type_decode(float *value, const void *bytes, size_t length, void *memory,
                                    size_t memory_bytes) {
    rp_unpacker unpacker = rp_unpacker_of(bytes, length, memory, memory_bytes);
    rp_unpacker *from = &unpacker;
    *value = rp_unpack_f32(from);
    if (unpacker.left != 0) {
        rp_unpack_fail(from, RP_LONG);
    }
    return unpacker.code;
}


/** The interface as a module answers `describe` with it: 2712 bytes. */
static const uint8_t zoo_description[2712] = {
    2, 3, 90, 111, 111, 3, 122, 111, 111, 33, 65, 108, 108, 32, 107, 105, 110, 100, 115, 32,
    111, 102, 32, 116, 121, 112, 101, 115, 44, 32, 97, 110, 100, 32, 111, 102, 32, 110, 97, 109,
    101, 115, 46, 4, 16, 4, 102, 101, 101, 100, 10, 70, 101, 101, 100, 115, 32, 111, 110, 101,
    46, 1, 3, 4, 102, 114, 111, 109, 14, 2, 107, 103, 8, 0, 0, 0, 0, 0, 0, 0,
    0, 8, 0, 0, 0, 0, 0, 128, 52, 64, 13, 5, 99, 111, 117, 110, 116, 4, 1, 1,
    2, 5, 111, 114, 100, 101, 114, 0, 23, 5, 79, 114, 100, 101, 114, 11, 87, 104, 97, 116,
    32, 116, 111, 32, 100, 111, 46, 5, 4, 83, 116, 111, 112, 0, 0, 2, 71, 111, 9, 72,
    111, 119, 32, 102, 97, 115, 116, 46, 1, 0, 2, 3, 109, 47, 115, 13, 4, 72, 111, 108,
    100, 0, 1, 0, 0, 17, 2, 4, 84, 117, 114, 110, 0, 2, 2, 0, 0, 9, 0, 0,
    1, 5, 68, 114, 105, 118, 101, 0, 3, 2, 9, 115, 112, 101, 101, 100, 95, 109, 95, 115,
    15, 8, 70, 111, 114, 119, 97, 114, 100, 46, 3, 109, 47, 115, 8, 0, 0, 0, 0, 0,
    0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 248, 63, 13, 5, 117, 110, 116, 105, 108, 0,
    17, 23, 4, 76, 97, 109, 112, 53, 87, 104, 101, 116, 104, 101, 114, 32, 105, 116, 32, 115,
    104, 105, 110, 101, 115, 46, 32, 34, 81, 117, 111, 116, 101, 100, 34, 32, 42, 47, 32, 116,
    101, 120, 116, 32, 34, 34, 34, 32, 119, 105, 116, 104, 32, 92, 32, 115, 105, 103, 110, 115,
    46, 3, 3, 79, 102, 102, 5, 68, 97, 114, 107, 46, 0, 7, 111, 110, 45, 102, 117, 108,
    108, 0, 0, 4, 78, 111, 110, 101, 0, 0, 23, 6, 82, 101, 115, 117, 108, 116, 0, 2,
    2, 79, 107, 0, 1, 0, 0, 22, 6, 77, 101, 116, 101, 114, 115, 9, 65, 32, 108, 101,
    110, 103, 116, 104, 46, 1, 0, 14, 1, 109, 4, 0, 0, 128, 191, 4, 40, 107, 110, 78,
    12, 3, 69, 114, 114, 0, 1, 0, 0, 23, 4, 76, 97, 109, 112, 53, 87, 104, 101, 116,
    104, 101, 114, 32, 105, 116, 32, 115, 104, 105, 110, 101, 115, 46, 32, 34, 81, 117, 111, 116,
    101, 100, 34, 32, 42, 47, 32, 116, 101, 120, 116, 32, 34, 34, 34, 32, 119, 105, 116, 104,
    32, 92, 32, 115, 105, 103, 110, 115, 46, 3, 3, 79, 102, 102, 5, 68, 97, 114, 107, 46,
    0, 7, 111, 110, 45, 102, 117, 108, 108, 0, 0, 4, 78, 111, 110, 101, 0, 0, 17, 8,
    99, 111, 110, 116, 105, 110, 117, 101, 0, 0, 0, 0, 18, 7, 112, 117, 98, 108, 105, 115,
    104, 0, 0, 2, 6, 108, 97, 109, 98, 100, 97, 0, 22, 8, 116, 101, 115, 116, 46, 80,
    101, 110, 0, 3, 1, 6, 105, 110, 115, 105, 100, 101, 0, 23, 4, 76, 97, 109, 112, 53,
    87, 104, 101, 116, 104, 101, 114, 32, 105, 116, 32, 115, 104, 105, 110, 101, 115, 46, 32, 34,
    81, 117, 111, 116, 101, 100, 34, 32, 42, 47, 32, 116, 101, 120, 116, 32, 34, 34, 34, 32,
    119, 105, 116, 104, 32, 92, 32, 115, 105, 103, 110, 115, 46, 3, 3, 79, 102, 102, 5, 68,
    97, 114, 107, 46, 0, 7, 111, 110, 45, 102, 117, 108, 108, 0, 0, 4, 78, 111, 110, 101,
    0, 0, 5, 111, 116, 104, 101, 114, 0, 22, 8, 116, 101, 115, 116, 46, 80, 101, 110, 0,
    3, 1, 6, 105, 110, 115, 105, 100, 101, 0, 2, 17, 22, 17, 114, 111, 104, 114, 112, 111,
    115, 116, 46, 79, 100, 111, 109, 101, 116, 114, 121, 80, 87, 104, 97, 116, 32, 97, 32, 98,
    97, 115, 101, 32, 115, 97, 121, 115, 32, 111, 102, 32, 105, 116, 115, 32, 111, 119, 110, 32,
    109, 111, 116, 105, 111, 110, 58, 32, 99, 111, 117, 110, 116, 101, 100, 32, 102, 114, 111, 109,
    32, 119, 104, 101, 114, 101, 32, 105, 116, 32, 115, 116, 97, 114, 116, 101, 100, 44, 32, 97,
    110, 100, 32, 100, 114, 105, 102, 116, 105, 110, 103, 46, 3, 2, 4, 112, 111, 115, 101, 1,
    64, 87, 104, 101, 114, 101, 32, 116, 104, 101, 32, 98, 97, 115, 101, 32, 98, 101, 108, 105,
    101, 118, 101, 115, 32, 116, 111, 32, 98, 101, 44, 32, 105, 110, 32, 116, 104, 101, 32, 102,
    114, 97, 109, 101, 32, 105, 110, 32, 119, 104, 105, 99, 104, 32, 105, 116, 32, 115, 116, 97,
    114, 116, 101, 100, 46, 22, 13, 114, 111, 104, 114, 112, 111, 115, 116, 46, 80, 111, 115, 101,
    35, 65, 32, 112, 108, 97, 99, 101, 32, 97, 110, 100, 32, 97, 32, 104, 101, 97, 100, 105,
    110, 103, 32, 105, 110, 32, 116, 104, 101, 32, 112, 108, 97, 110, 101, 46, 3, 3, 3, 120,
    95, 109, 3, 15, 77, 101, 116, 114, 101, 115, 32, 97, 108, 111, 110, 103, 32, 120, 46, 1,
    109, 13, 3, 121, 95, 109, 3, 15, 77, 101, 116, 114, 101, 115, 32, 97, 108, 111, 110, 103,
    32, 121, 46, 1, 109, 13, 11, 104, 101, 97, 100, 105, 110, 103, 95, 114, 97, 100, 3, 71,
    82, 97, 100, 105, 97, 110, 115, 44, 32, 99, 111, 117, 110, 116, 101, 114, 45, 99, 108, 111,
    99, 107, 119, 105, 115, 101, 32, 102, 114, 111, 109, 32, 120, 59, 32, 97, 110, 121, 32, 109,
    117, 108, 116, 105, 112, 108, 101, 32, 111, 102, 32, 97, 32, 116, 117, 114, 110, 32, 109, 97,
    121, 32, 98, 101, 32, 97, 100, 100, 101, 100, 46, 3, 114, 97, 100, 13, 5, 116, 119, 105,
    115, 116, 1, 17, 72, 111, 119, 32, 105, 116, 32, 109, 111, 118, 101, 115, 32, 110, 111, 119,
    46, 22, 14, 114, 111, 104, 114, 112, 111, 115, 116, 46, 84, 119, 105, 115, 116, 39, 72, 111,
    119, 32, 102, 97, 115, 116, 32, 97, 32, 98, 111, 100, 121, 32, 109, 111, 118, 101, 115, 32,
    105, 110, 32, 105, 116, 115, 32, 111, 119, 110, 32, 102, 114, 97, 109, 101, 46, 3, 2, 9,
    115, 112, 101, 101, 100, 95, 109, 95, 115, 3, 25, 77, 101, 116, 114, 101, 115, 32, 97, 32,
    115, 101, 99, 111, 110, 100, 44, 32, 102, 111, 114, 119, 97, 114, 100, 46, 3, 109, 47, 115,
    13, 15, 116, 117, 114, 110, 95, 114, 97, 116, 101, 95, 114, 97, 100, 95, 115, 3, 36, 82,
    97, 100, 105, 97, 110, 115, 32, 97, 32, 115, 101, 99, 111, 110, 100, 44, 32, 99, 111, 117,
    110, 116, 101, 114, 45, 99, 108, 111, 99, 107, 119, 105, 115, 101, 46, 5, 114, 97, 100, 47,
    115, 13, 172, 2, 5, 99, 108, 101, 97, 110, 25, 84, 119, 111, 32, 101, 114, 114, 111, 114,
    115, 32, 104, 97, 118, 101, 32, 111, 110, 101, 32, 110, 97, 109, 101, 46, 0, 1, 6, 109,
    97, 114, 107, 101, 114, 0, 22, 6, 77, 97, 114, 107, 101, 114, 14, 78, 111, 116, 104, 105,
    110, 103, 32, 105, 110, 32, 105, 116, 46, 0, 23, 6, 82, 101, 115, 117, 108, 116, 0, 2,
    2, 79, 107, 0, 1, 0, 0, 0, 3, 69, 114, 114, 0, 1, 0, 0, 15, 3, 1, 0,
    7, 97, 110, 105, 109, 97, 108, 115, 1, 12, 65, 108, 108, 32, 97, 110, 105, 109, 97, 108,
    115, 46, 22, 8, 116, 101, 115, 116, 46, 90, 111, 111, 0, 3, 27, 7, 110, 117, 109, 98,
    101, 114, 115, 0, 22, 7, 78, 117, 109, 98, 101, 114, 115, 21, 78, 117, 109, 98, 101, 114,
    115, 32, 111, 102, 32, 97, 108, 108, 32, 115, 105, 122, 101, 115, 46, 3, 4, 6, 115, 105,
    103, 110, 101, 100, 0, 21, 5, 7, 8, 9, 10, 11, 8, 117, 110, 115, 105, 103, 110, 101,
    100, 0, 21, 4, 2, 3, 4, 5, 4, 104, 117, 103, 101, 0, 6, 6, 102, 108, 111, 97,
    116, 115, 0, 21, 2, 12, 13, 5, 115, 109, 97, 108, 108, 0, 19, 3, 13, 7, 110, 111,
    95, 114, 111, 111, 109, 0, 19, 0, 2, 4, 102, 108, 97, 103, 0, 1, 6, 108, 101, 116,
    116, 101, 114, 0, 14, 4, 110, 97, 109, 101, 0, 15, 7, 110, 111, 116, 104, 105, 110, 103,
    0, 0, 8, 100, 105, 115, 116, 97, 110, 99, 101, 0, 22, 6, 77, 101, 116, 101, 114, 115,
    9, 65, 32, 108, 101, 110, 103, 116, 104, 46, 1, 0, 14, 1, 109, 4, 0, 0, 128, 191,
    4, 40, 107, 110, 78, 12, 4, 112, 97, 105, 114, 0, 22, 4, 80, 97, 105, 114, 0, 2,
    2, 0, 2, 2, 194, 176, 8, 0, 0, 14, 5, 109, 97, 121, 98, 101, 0, 17, 2, 6,
    110, 101, 115, 116, 101, 100, 0, 19, 3, 17, 17, 2, 12, 115, 111, 109, 101, 95, 110, 111,
    116, 104, 105, 110, 103, 0, 19, 2, 17, 0, 6, 111, 114, 100, 101, 114, 115, 0, 18, 23,
    5, 79, 114, 100, 101, 114, 11, 87, 104, 97, 116, 32, 116, 111, 32, 100, 111, 46, 5, 4,
    83, 116, 111, 112, 0, 0, 2, 71, 111, 9, 72, 111, 119, 32, 102, 97, 115, 116, 46, 1,
    0, 2, 3, 109, 47, 115, 13, 4, 72, 111, 108, 100, 0, 1, 0, 0, 17, 2, 4, 84,
    117, 114, 110, 0, 2, 2, 0, 0, 9, 0, 0, 1, 5, 68, 114, 105, 118, 101, 0, 3,
    2, 9, 115, 112, 101, 101, 100, 95, 109, 95, 115, 15, 8, 70, 111, 114, 119, 97, 114, 100,
    46, 3, 109, 47, 115, 8, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0,
    0, 248, 63, 13, 5, 117, 110, 116, 105, 108, 0, 17, 23, 4, 76, 97, 109, 112, 53, 87,
    104, 101, 116, 104, 101, 114, 32, 105, 116, 32, 115, 104, 105, 110, 101, 115, 46, 32, 34, 81,
    117, 111, 116, 101, 100, 34, 32, 42, 47, 32, 116, 101, 120, 116, 32, 34, 34, 34, 32, 119,
    105, 116, 104, 32, 92, 32, 115, 105, 103, 110, 115, 46, 3, 3, 79, 102, 102, 5, 68, 97,
    114, 107, 46, 0, 7, 111, 110, 45, 102, 117, 108, 108, 0, 0, 4, 78, 111, 110, 101, 0,
    0, 5, 98, 121, 116, 101, 115, 0, 18, 2, 4, 98, 108, 111, 98, 0, 16, 5, 108, 105,
    115, 116, 115, 0, 18, 18, 8, 7, 98, 121, 95, 110, 97, 109, 101, 0, 20, 15, 3, 9,
    98, 121, 95, 110, 117, 109, 98, 101, 114, 0, 20, 10, 14, 7, 98, 121, 95, 108, 97, 109,
    112, 0, 20, 23, 4, 76, 97, 109, 112, 53, 87, 104, 101, 116, 104, 101, 114, 32, 105, 116,
    32, 115, 104, 105, 110, 101, 115, 46, 32, 34, 81, 117, 111, 116, 101, 100, 34, 32, 42, 47,
    32, 116, 101, 120, 116, 32, 34, 34, 34, 32, 119, 105, 116, 104, 32, 92, 32, 115, 105, 103,
    110, 115, 46, 3, 3, 79, 102, 102, 5, 68, 97, 114, 107, 46, 0, 7, 111, 110, 45, 102,
    117, 108, 108, 0, 0, 4, 78, 111, 110, 101, 0, 0, 1, 8, 98, 121, 95, 112, 108, 97,
    99, 101, 0, 20, 21, 2, 7, 7, 12, 6, 114, 101, 115, 117, 108, 116, 0, 23, 6, 82,
    101, 115, 117, 108, 116, 0, 2, 2, 79, 107, 0, 1, 0, 0, 2, 3, 69, 114, 114, 0,
    1, 0, 0, 15, 5, 117, 110, 105, 116, 115, 0, 18, 0, 5, 99, 108, 97, 115, 115, 1,
    38, 84, 104, 101, 32, 115, 97, 109, 101, 32, 119, 111, 114, 100, 32, 105, 110, 32, 80, 121,
    116, 104, 111, 110, 44, 32, 82, 117, 115, 116, 32, 97, 110, 100, 32, 67, 43, 43, 46, 2,
    4, 102, 114, 111, 109, 0, 7, 4, 116, 121, 112, 101, 0, 2, 9, 79, 100, 100, 32, 110,
    97, 109, 101, 33, 0, 2, 8, 111, 100, 100, 95, 110, 97, 109, 101, 0, 2, 3, 1, 8,
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
    119, 105, 115, 101, 46, 5, 114, 97, 100, 47, 115, 13, 128, 128, 1, 0, 4, 116, 121, 112,
    101, 6, 3, 114, 97, 100, 4, 205, 204, 76, 192, 12,
};

#endif
