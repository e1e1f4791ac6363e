// A module that asks its runtime for all that there is, rightly and wrongly. Its function `check` fails with what is
// not as it should be.

#include "rohrpost.h"

#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { CHECK_ALL = 16, FAIL = 17, FORK = 18, TYPO = 19, BAD_REPLY = 20, SMALL = 1, SECOND_NS = 1000 * 1000 * 1000 };

static const rohrpost_function FUNCTIONS[] = {
    ROHRPOST_ASKED(CHECK_ALL, "check", ROHRPOST_TEXT, "Its settings, if all is well."),
    ROHRPOST_ASKED(FAIL, "fail", ROHRPOST_UNIT, NULL),
    ROHRPOST_ASKED(FORK, "fork", ROHRPOST_UNIT, NULL),
    ROHRPOST_ASKED(TYPO, "typo", ROHRPOST_UNIT, NULL),
    ROHRPOST_ASKED(BAD_REPLY, "bad_reply", ROHRPOST_UNIT, NULL),
};
static const rohrpost_field SMALL_FIELDS[] = {
    ROHRPOST_FIELD("number", ROHRPOST_U8, NULL, NULL),
    ROHRPOST_FIELD("bytes", ROHRPOST_BYTES, NULL, NULL),
};
static const rohrpost_named SMALL_RECORD = ROHRPOST_NAMED("Small", NULL, SMALL_FIELDS);
static const rohrpost_data DATA[] = {
    ROHRPOST_STREAMED(SMALL, "small", ROHRPOST_STRUCT(SMALL_RECORD), NULL, "Too small to be written in place."),
};
static const rohrpost_interface ASKER =
    ROHRPOST_INTERFACE("Asker", "asker", NULL, ROHRPOST_ALL(FUNCTIONS), ROHRPOST_ALL(DATA));
// The other module's, as `docs/src/c.md` has it; and as it may have been once, with another unit.
static const rohrpost_field CALIBRATE_ARGUMENTS[] = {
    ROHRPOST_FIELD("true_c", ROHRPOST_F64, "°C", "What another thermometer says."),
};
static const rohrpost_function CALIBRATE[] = {
    ROHRPOST_FUNCTION(16, "calibrate", CALIBRATE_ARGUMENTS, ROHRPOST_F64, "Returns the correction from now on."),
};
static const rohrpost_data CELSIUS[] = {
    ROHRPOST_PUBLISHED(1, "temperature", ROHRPOST_F64, "°C", "Of the motor's winding."),
};
static const rohrpost_data KELVIN[] = {
    ROHRPOST_PUBLISHED(1, "temperature", ROHRPOST_F64, "K", "Of the motor's winding."),
};
static const rohrpost_interface THERMOMETER = ROHRPOST_INTERFACE("Thermometer", "thermometer",
    "Says how warm the motor is.", ROHRPOST_ALL(CALIBRATE), ROHRPOST_ALL(CELSIUS));
static const rohrpost_interface OLD_THERMOMETER = ROHRPOST_INTERFACE("Thermometer", "thermometer",
    "Says how warm the motor is.", ROHRPOST_ALL(CALIBRATE), ROHRPOST_ALL(KELVIN));
static const rohrpost_parameter PARAMETERS[] = {
    ROHRPOST_PARAMETER("share", ROHRPOST_U8, "%", NULL, "50", "1", "100"),
};
static const char *const SETTINGS[] = {"name", "list"};

// What came of each thing that it follows.
static unsigned came[4];

#define GIVES(code, call)                                                                              \
    do {                                                                                               \
        rohrpost_outcome given_ = (call);                                                               \
        if (given_ != (code)) {                                                                        \
            char why_[1500];                                                                           \
            snprintf(why_, sizeof why_, "%d: %s gives %d, %s", __LINE__, #call, (int)given_, rohrpost_last_error()); \
            return rohrpost_fail(why_);                                                                \
        }                                                                                              \
    } while (0)
#define DONE(call) GIVES(ROHRPOST_OK, call)
#define HOLDS(what)                                                                                    \
    do {                                                                                               \
        if (!(what)) {                                                                                 \
            return rohrpost_fail(#what);                                                               \
        }                                                                                              \
    } while (0)

static rohrpost_outcome made(void *user) {
    (void)user;
    uint32_t follow;
    DONE(rohrpost_module_follow("thermometer.0", "temperature", ROHRPOST_FOLLOW_EACH, 0, &follow));
    HOLDS(follow == 0);
    DONE(rohrpost_module_follow("thermometer.0", "temperature", ROHRPOST_FOLLOW_NEWEST, 0, &follow));
    DONE(rohrpost_module_follow("thermometer.0", "temperature", ROHRPOST_FOLLOW_PERIOD, SECOND_NS / 5, &follow));
    HOLDS(follow == 2);
    GIVES(ROHRPOST_CONFIGURATION, rohrpost_module_follow("nobody.0", "x", ROHRPOST_FOLLOW_EACH, 0, &follow));
    // Left open: it is given up when the function ends.
    uint8_t *room;
    DONE(rohrpost_module_begin(SMALL, 0, "\x01\x00", 2, 1, &room));
    return ROHRPOST_OK;
}

static rohrpost_outcome on(void *user) {
    (void)user;
    uint8_t *room;
    DONE(rohrpost_module_begin(SMALL, 0, "\x01\x00", 2, 1, &room));
    return rohrpost_module_abandon();
}

static rohrpost_outcome received(void *user, const rohrpost_followed *data) {
    (void)user;
    HOLDS(data->follow < 4 && data->number == 1 && data->stamp_ns > 0);
    rohrpost_decoder decoder = rohrpost_decode(data->value, data->len);
    rohrpost_get_f64(&decoder);
    came[data->follow] += 1;
    return rohrpost_decoded(&decoder);
}

static rohrpost_outcome calls(void) {
    uint8_t bytes[32];
    size_t len;
    rohrpost_decoder reply;
    rohrpost_encoder encoder = rohrpost_encode(bytes, sizeof bytes);
    rohrpost_put_f64(&encoder, 30);
    DONE(rohrpost_encoded(&encoder, &len));
    const uint64_t long_ns = 60 * (uint64_t)SECOND_NS;
    uint32_t hash, old;
    DONE(rohrpost_interface_hash(&THERMOMETER, &hash));
    DONE(rohrpost_interface_hash(&OLD_THERMOMETER, &old));
    DONE(rohrpost_module_call("thermometer.0", hash, 16, bytes, len, long_ns, &reply));
    HOLDS(rohrpost_get_f64(&reply) == 10);
    DONE(rohrpost_decoded(&reply));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_module_call("thermometer.0", hash, 16, bytes, len, long_ns, NULL));
    GIVES(ROHRPOST_FAULT, rohrpost_module_call("thermometer.0", hash, 16, bytes, len - 1, long_ns, &reply));
    GIVES(ROHRPOST_FAULT, rohrpost_module_call("thermometer.0", hash, 99, NULL, 0, long_ns, &reply));
    // By another interface nothing is run, and nothing is read.
    reply = rohrpost_decode("\x07", 1);
    GIVES(ROHRPOST_FAULT, rohrpost_module_call("thermometer.0", old, 16, bytes, len, long_ns, &reply));
    HOLDS(strstr(rohrpost_last_error(), "interface differs") != NULL);
    HOLDS(rohrpost_get_u8(&reply) == 0 && rohrpost_decoded(&reply) == ROHRPOST_MALFORMED);
    GIVES(ROHRPOST_FAULT, rohrpost_module_get("thermometer.0", old, 1, long_ns, &reply));
    HOLDS(strstr(rohrpost_last_error(), "interface differs") != NULL);
    reply = rohrpost_decode("\x07", 1);
    GIVES(ROHRPOST_CONFIGURATION, rohrpost_module_call("nobody.0", hash, 16, NULL, 0, long_ns, &reply));
    HOLDS(rohrpost_get_u8(&reply) == 0 && rohrpost_decoded(&reply) == ROHRPOST_MALFORMED);
    DONE(rohrpost_module_get("thermometer.0", hash, 1, long_ns, &reply));
    HOLDS(rohrpost_get_u64(&reply) > 0);
    rohrpost_get_f64(&reply);
    return rohrpost_decoded(&reply);
}

static rohrpost_outcome own(void) {
    uint32_t name, watch;
    rohrpost_time now;
    rohrpost_decoder value;
    DONE(rohrpost_module_name(&name));
    HOLDS(name == ROHRPOST_NAME(1, 106, 0, 0));
    DONE(rohrpost_module_now(&now));
    HOLDS(now.ns > 0);
    DONE(rohrpost_module_parameter("share", &value));
    HOLDS(rohrpost_get_u8(&value) == 60);
    DONE(rohrpost_decoded(&value));
    DONE(rohrpost_module_set_parameter("share", "\x46", 1));
    GIVES(ROHRPOST_VALUE, rohrpost_module_set_parameter("share", "\x65", 1));
    GIVES(ROHRPOST_VALUE, rohrpost_module_set_parameter("share", "", 0));
    GIVES(ROHRPOST_NO_ITEM, rohrpost_module_set_parameter("speed", "\x46", 1));
    value = rohrpost_decode("\x07", 1);
    GIVES(ROHRPOST_NO_ITEM, rohrpost_module_parameter("speed", &value));
    // It is written all the same: nothing is in it.
    HOLDS(rohrpost_get_u8(&value) == 0 && rohrpost_decoded(&value) == ROHRPOST_MALFORMED);
    GIVES(ROHRPOST_VALUE, rohrpost_module_watch(9999, ROHRPOST_READ, &watch));
    GIVES(ROHRPOST_VALUE, rohrpost_module_unwatch(7));
    return ROHRPOST_OK;
}

static rohrpost_outcome records(void) {
    uint8_t *room;
    uint64_t first, second;
    static const uint8_t FRONT[] = {7, 0};
    GIVES(ROHRPOST_NO_ITEM, rohrpost_module_publish(2, 0, FRONT, 2));
    GIVES(ROHRPOST_NO_ITEM, rohrpost_module_begin(2, 0, FRONT, 2, 3, &room));
    GIVES(ROHRPOST_VALUE, rohrpost_module_finish(NULL));
    DONE(rohrpost_module_begin(SMALL, 0, FRONT, 2, 3, &room));
    GIVES(ROHRPOST_BUSY, rohrpost_module_publish(SMALL, 0, FRONT, 2));
    memcpy(room, "abc", 3);
    DONE(rohrpost_module_finish(&first));
    DONE(rohrpost_module_begin(SMALL, 0, FRONT, 2, 3, &room));
    DONE(rohrpost_module_abandon());
    DONE(rohrpost_module_publish(SMALL, 0, "\x08\x02xy", 4));
    DONE(rohrpost_module_begin(SMALL, 0, FRONT, 2, 1, &room));
    room[0] = 'z';
    DONE(rohrpost_module_finish(&second));
    HOLDS(second == first + 2);
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_module_begin(SMALL, 0, FRONT, 2, 100000, &room));
    // Left open: it is given up when the function ends.
    DONE(rohrpost_module_begin(SMALL, 0, FRONT, 2, 1, &room));
    return ROHRPOST_OK;
}

// Beside the module's own part in the node, another one.
static rohrpost_outcome beside(void) {
    rohrpost_node node;
    rohrpost_stream stream;
    rohrpost_stream_reader reader;
    rohrpost_record record;
    char text[16];
    DONE(rohrpost_node_open(&node));
    DONE(rohrpost_name_parse(node, "asker.0", &stream.name));
    DONE(rohrpost_name_text(node, stream.name, text, sizeof text));
    HOLDS(strcmp(text, "asker.0") == 0);
    stream.number = SMALL;
    DONE(rohrpost_stream_reader_open(node, stream, &reader));
    DONE(rohrpost_stream_newest(reader, &record));
    HOLDS(record.len == 3 && memcmp(record.body, "\x07\x01z", 3) == 0);
    // That was the only seat. What cannot be followed leaves nothing behind that hinders others.
    uint32_t follow;
    GIVES(ROHRPOST_RING, rohrpost_module_follow("asker.0", "small", ROHRPOST_FOLLOW_RECORDS, 0, &follow));
    DONE(rohrpost_module_follow("thermometer.0", "temperature", ROHRPOST_FOLLOW_NEWEST, 0, &follow));
    HOLDS(follow == 3);
    DONE(rohrpost_stream_reader_close(reader));
    return rohrpost_node_close(node);
}

// A child is no second module: its calls are refused, and it does not come back to the loop.
static rohrpost_outcome forks(void) {
    int status;
    pid_t child = fork();
    if (child == 0) {
        _exit(rohrpost_module_publish(SMALL, 0, "\x09\x00", 2) == ROHRPOST_FORKED ? 0 : 1);
    }
    HOLDS(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    child = fork();
    if (child == 0) {
        return ROHRPOST_OK;
    }
    HOLDS(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 70);
    return ROHRPOST_OK;
}

static rohrpost_outcome command(void *user, uint16_t number, rohrpost_decoder *arguments, rohrpost_encoder *reply) {
    (void)user;
    if (number == FORK) {
        return forks();
    }
    rohrpost_decoder value;
    if (number == TYPO) {
        return rohrpost_module_parameter("typo", &value);
    }
    if (number == BAD_REPLY) {
        value = rohrpost_decode("", 0);
        rohrpost_get_u8(&value);
        return rohrpost_decoded(&value);
    }
    if (number != CHECK_ALL) {
        // Without words: the last error is not another call's.
        return -1;
    }
    HOLDS(came[0] > 0 && came[1] > 0 && came[2] > 0);
    DONE(calls());
    DONE(own());
    DONE(records());
    DONE(beside());
    char settings[100];
    GIVES(ROHRPOST_SMALL_BUFFER, rohrpost_module_settings(settings, 5));
    DONE(rohrpost_module_settings(settings, sizeof settings));
    rohrpost_put_text(reply, settings, strlen(settings));
    return rohrpost_decoded(arguments);
}

int main(int count, char **arguments) {
    static rohrpost_module module;
    module.interface = &ASKER;
    module.parameters = PARAMETERS;
    module.parameter_count = ROHRPOST_COUNT(PARAMETERS);
    module.settings = SETTINGS;
    module.setting_count = ROHRPOST_COUNT(SETTINGS);
    module.made = made;
    module.on = on;
    module.received = received;
    module.command = command;
    return rohrpost_module_run(&module, count, (const char *const *)arguments);
}
