// Values as bytes, both ways, in C11 and as C++.

#include "check.h"

#include <float.h>
#include <math.h>

static uint8_t buffer[512];

static rohrpost_decoder decoded_again(const rohrpost_encoder *encoder) {
    size_t len;
    DONE(rohrpost_encoded(encoder, &len));
    return rohrpost_decode(buffer, len);
}

static void values_come_back(void) {
    rohrpost_encoder e = rohrpost_encode(buffer, sizeof buffer);
    rohrpost_put_bool(&e, true);
    rohrpost_put_u8(&e, UINT8_MAX);
    rohrpost_put_u16(&e, UINT16_MAX);
    rohrpost_put_u32(&e, UINT32_MAX);
    rohrpost_put_u64(&e, UINT64_MAX);
    rohrpost_put_u128(&e, UINT64_MAX, 1);
    rohrpost_put_i8(&e, INT8_MIN);
    rohrpost_put_i16(&e, INT16_MIN);
    rohrpost_put_i32(&e, INT32_MIN);
    rohrpost_put_i64(&e, INT64_MIN);
    rohrpost_put_i128(&e, INT64_MIN, 2);
    rohrpost_put_f32(&e, FLT_MIN);
    rohrpost_put_f64(&e, (double)NAN);
    rohrpost_put_char(&e, 0x1f680);
    rohrpost_put_text(&e, "gr\xc3\xbc\xc3\x9f", 6);
    rohrpost_put_bytes(&e, "\0\xff", 2);
    rohrpost_put_variant(&e, 300);
    rohrpost_put_length(&e, 3);
    rohrpost_put_bool(&e, false);
    rohrpost_put_u8(&e, 1);
    rohrpost_put_u8(&e, 2);
    rohrpost_decoder d = decoded_again(&e);
    CHECK(rohrpost_get_bool(&d));
    CHECK(rohrpost_get_u8(&d) == UINT8_MAX);
    CHECK(rohrpost_get_u16(&d) == UINT16_MAX);
    CHECK(rohrpost_get_u32(&d) == UINT32_MAX);
    CHECK(rohrpost_get_u64(&d) == UINT64_MAX);
    uint64_t high;
    CHECK(rohrpost_get_u128(&d, &high) == 1 && high == UINT64_MAX);
    CHECK(rohrpost_get_i8(&d) == INT8_MIN);
    CHECK(rohrpost_get_i16(&d) == INT16_MIN);
    CHECK(rohrpost_get_i32(&d) == INT32_MIN);
    CHECK(rohrpost_get_i64(&d) == INT64_MIN);
    int64_t signed_high;
    CHECK(rohrpost_get_i128(&d, &signed_high) == 2 && signed_high == INT64_MIN);
    CHECK(rohrpost_get_f32(&d) == FLT_MIN);
    CHECK(isnan(rohrpost_get_f64(&d)));
    CHECK(rohrpost_get_char(&d) == 0x1f680);
    size_t len;
    const char *text = rohrpost_get_text(&d, &len);
    CHECK(len == 6 && memcmp(text, "gr\xc3\xbc\xc3\x9f", 6) == 0);
    const uint8_t *bytes = rohrpost_get_bytes(&d, &len);
    CHECK(len == 2 && bytes[0] == 0 && bytes[1] == 0xff);
    CHECK(rohrpost_get_variant(&d) == 300);
    CHECK(rohrpost_get_length(&d, 1) == 3);
    CHECK(!rohrpost_get_bool(&d));
    GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    SAYS("2 bytes are left");
    CHECK(rohrpost_get_u8(&d) == 1 && rohrpost_get_u8(&d) == 2);
    DONE(rohrpost_decoded(&d));
}

// All that is behind the end, or of another type, is 0 and a code at the end.
static void nothing_is_read_behind_the_end(void) {
    // The number of a list's elements is checked against the bytes that are there.
    const uint8_t many[] = {0xff, 0xff, 0x03, 1};
    rohrpost_decoder d = rohrpost_decode(many, sizeof many);
    CHECK(rohrpost_get_length(&d, 1) == 0);
    CHECK(rohrpost_get_u8(&d) == 0);
    GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    for (size_t len = 0; len < 4; len++) {
        d = rohrpost_decode("\x03" "ab", len);
        size_t there = 77;
        CHECK(rohrpost_get_text(&d, &there) != NULL && there == 0);
        GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    }
    d = rohrpost_decode("\x02\xff\xff", 3);
    size_t len = 77;
    rohrpost_get_text(&d, &len);
    CHECK(len == 0);
    GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    d = rohrpost_decode("\x02", 1);
    CHECK(!rohrpost_get_bool(&d));
    GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    d = rohrpost_decode(NULL, 3);
    CHECK(rohrpost_get_u64(&d) == 0);
    GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    // Of zeros, as C makes what is not written yet.
    memset(&d, 0, sizeof d);
    CHECK(rohrpost_get_u8(&d) == 0);
    GIVES(ROHRPOST_MALFORMED, rohrpost_decoded(&d));
    CHECK(rohrpost_get_u64(NULL) == 0);
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_decoded(NULL));
}

static void nothing_is_written_behind_the_end(void) {
    memset(buffer, 0x5a, sizeof buffer);
    size_t len;
    rohrpost_encoder e = rohrpost_encode(buffer, 10);
    rohrpost_put_f64(&e, 1.0);
    rohrpost_put_text(&e, "long", 4);
    rohrpost_put_u8(&e, 1);
    GIVES(ROHRPOST_SMALL_BUFFER, rohrpost_encoded(&e, &len));
    CHECK(len == 8 && buffer[10] == 0x5a);
    e = rohrpost_encode(NULL, 10);
    rohrpost_put_u8(&e, 1);
    GIVES(ROHRPOST_SMALL_BUFFER, rohrpost_encoded(&e, &len));
    memset(&e, 0, sizeof e);
    rohrpost_put_u8(&e, 1);
    GIVES(ROHRPOST_SMALL_BUFFER, rohrpost_encoded(&e, &len));
    e = rohrpost_encode(buffer, 10);
    rohrpost_put_char(&e, 0xd800);
    GIVES(ROHRPOST_VALUE, rohrpost_encoded(&e, &len));
    e = rohrpost_encode(buffer, 10);
    rohrpost_put_text(&e, "\xff", 1);
    GIVES(ROHRPOST_VALUE, rohrpost_encoded(&e, &len));
    e = rohrpost_encode(buffer, 10);
    rohrpost_put_bytes(&e, NULL, 1);
    GIVES(ROHRPOST_VALUE, rohrpost_encoded(&e, &len));
    rohrpost_put_u8(NULL, 1);
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_encoded(NULL, &len));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_encoded(&e, NULL));
}

int main(void) {
    values_come_back();
    nothing_is_read_behind_the_end();
    nothing_is_written_behind_the_end();
    puts("all is well");
    return 0;
}
