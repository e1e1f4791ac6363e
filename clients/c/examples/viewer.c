// Looks at a camera's pictures in place, publishes how bright they are, and tells how many it has seen.

#include <rohrpost_types.h>

// Numbers of its function and its data.
enum { SEEN = 16, BRIGHTNESS = 1 };

static const rohrpost_function FUNCTIONS[] = {
    ROHRPOST_ASKED(SEEN, "seen", ROHRPOST_U64, "How many pictures it has seen."),
};
static const rohrpost_data DATA[] = {
    ROHRPOST_PUBLISHED(BRIGHTNESS, "brightness", ROHRPOST_F64, NULL, "Of the whole picture, 0 to 255."),
};
static const rohrpost_interface VIEWER = ROHRPOST_INTERFACE(
    "Viewer", "viewer", "Says how bright a picture is.", ROHRPOST_ALL(FUNCTIONS), ROHRPOST_ALL(DATA));

static rohrpost_outcome made(void *user) {
    (void)user;
    uint32_t follow;
    return rohrpost_module_follow("camera.0", "image", ROHRPOST_FOLLOW_RECORDS, 0, &follow);
}

static rohrpost_outcome received(void *user, const rohrpost_followed *data) {
    // In the memory where the camera has written it.
    rohrpost_decoder decoder = rohrpost_decode(data->value, data->len);
    rohrpost_get_image(&decoder);
    size_t len;
    const uint8_t *pixels = rohrpost_get_bytes(&decoder, &len);
    rohrpost_outcome outcome = rohrpost_decoded(&decoder);
    if (outcome != ROHRPOST_OK) {
        return outcome;
    }
    double sum = 0;
    for (size_t at = 0; at < len; at++) {
        sum += pixels[at];
    }
    uint8_t bytes[8];
    rohrpost_encoder encoder = rohrpost_encode(bytes, sizeof bytes);
    rohrpost_put_f64(&encoder, len == 0 ? 0 : sum / (double)len);
    *(uint64_t *)user += 1;
    return rohrpost_module_publish(BRIGHTNESS, data->stamp_ns, bytes, sizeof bytes);
}

static rohrpost_outcome command(void *user, uint16_t number, rohrpost_decoder *arguments, rohrpost_encoder *reply) {
    if (number != SEEN) {
        return ROHRPOST_NO_ITEM;
    }
    rohrpost_put_u64(reply, *(const uint64_t *)user);
    return rohrpost_decoded(arguments);
}

int main(int count, char **arguments) {
    static uint64_t seen;
    static rohrpost_module module;
    module.interface = &VIEWER;
    module.user = &seen;
    module.made = made;
    module.received = received;
    module.command = command;
    return rohrpost_module_run(&module, count, (const char *const *)arguments);
}
