// A camera that writes its pictures in place: into the memory that all readers of the stream see, without a copy.

#include <rohrpost_types.h>

enum { WIDTH_PX = 320, HEIGHT_PX = 240, ROW_BYTES = WIDTH_PX * 3 };

// What a driver of a real camera would do here: have the device write to `pixels`.
static void take_picture(uint8_t *pixels, uint8_t number) {
    for (size_t row = 0; row < HEIGHT_PX; row++) {
        for (size_t column = 0; column < WIDTH_PX; column++) {
            uint8_t *pixel = pixels + row * ROW_BYTES + column * 3;
            pixel[0] = number;
            pixel[1] = (uint8_t)row;
            pixel[2] = (uint8_t)column;
        }
    }
}

static rohrpost_outcome made(void *user) {
    (void)user;
    return rohrpost_module_period(20 * 1000 * 1000);
}

static rohrpost_outcome tick(void *user) {
    uint8_t *number = (uint8_t *)user;
    const rohrpost_image image = {WIDTH_PX, HEIGHT_PX, ROW_BYTES, ROHRPOST_RGB8};
    uint8_t front[32];
    size_t front_len;
    rohrpost_encoder encoder = rohrpost_encode(front, sizeof front);
    rohrpost_put_image(&encoder, &image);
    rohrpost_put_length(&encoder, 0);
    rohrpost_outcome outcome = rohrpost_encoded(&encoder, &front_len);
    if (outcome != ROHRPOST_OK) {
        return outcome;
    }
    uint8_t *pixels;
    outcome = rohrpost_module_begin(ROHRPOST_CAMERA_IMAGE, 0, front, front_len, ROW_BYTES * HEIGHT_PX, &pixels);
    if (outcome != ROHRPOST_OK) {
        return outcome;
    }
    take_picture(pixels, (*number)++);
    return rohrpost_module_finish(NULL);
}

int main(int count, char **arguments) {
    static uint8_t number;
    static rohrpost_module module;
    module.interface = &ROHRPOST_CAMERA;
    module.user = &number;
    module.made = made;
    module.tick = tick;
    return rohrpost_module_run(&module, count, (const char *const *)arguments);
}
