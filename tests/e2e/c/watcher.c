// Looks at all of a camera's pictures in place: each is whole, and counted as its record is.

#include <rohrpost_types.h>

enum { SEEN = 16, JUMPS = 17, WIDTH_PX = 320, PIXEL_BYTES = 3 };

static const rohrpost_function FUNCTIONS[] = {
    ROHRPOST_ASKED(SEEN, "seen", ROHRPOST_U64, "How many whole pictures it has seen."),
    ROHRPOST_ASKED(JUMPS, "jumps", ROHRPOST_U64,
                   "How often pictures and records were not counted alike; once for each restart of the camera."),
};
static const rohrpost_interface WATCHER = ROHRPOST_INTERFACE(
    "Watcher", "viewer", "Looks at all of a camera's pictures.", ROHRPOST_ALL(FUNCTIONS), ROHRPOST_NONE);

typedef struct {
    uint64_t seen;
    uint64_t jumps;
    // By how much the number of the last picture was ahead of its record's, modulo 256.
    uint8_t ahead;
} watcher;

static rohrpost_outcome made(void *user) {
    (void)user;
    uint32_t follow;
    return rohrpost_module_follow("camera.0", "image", ROHRPOST_FOLLOW_RECORDS, 0, &follow);
}

static rohrpost_outcome received(void *user, const rohrpost_followed *data) {
    watcher *me = (watcher *)user;
    rohrpost_decoder decoder = rohrpost_decode(data->value, data->len);
    rohrpost_get_image(&decoder);
    size_t len;
    const uint8_t *pixels = rohrpost_get_bytes(&decoder, &len);
    rohrpost_outcome outcome = rohrpost_decoded(&decoder);
    if (outcome != ROHRPOST_OK) {
        return outcome;
    }
    for (size_t at = 0; at < len; at += PIXEL_BYTES) {
        const size_t index = at / PIXEL_BYTES;
        if (pixels[at] != pixels[0] || pixels[at + 1] != (uint8_t)(index / WIDTH_PX) ||
            pixels[at + 2] != (uint8_t)(index % WIDTH_PX)) {
            return rohrpost_fail("a picture is of two");
        }
    }
    const uint8_t ahead = (uint8_t)(pixels[0] - data->sequence);
    me->jumps += me->seen > 0 && ahead != me->ahead;
    me->ahead = ahead;
    me->seen++;
    return ROHRPOST_OK;
}

static rohrpost_outcome command(void *user, uint16_t number, rohrpost_decoder *arguments, rohrpost_encoder *reply) {
    const watcher *me = (const watcher *)user;
    rohrpost_put_u64(reply, number == SEEN ? me->seen : me->jumps);
    return rohrpost_decoded(arguments);
}

int main(int count, char **arguments) {
    static watcher me;
    static rohrpost_module module;
    module.interface = &WATCHER;
    module.user = &me;
    module.made = made;
    module.received = received;
    module.command = command;
    return rohrpost_module_run(&module, count, (const char *const *)arguments);
}
