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
