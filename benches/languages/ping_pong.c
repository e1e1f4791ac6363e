// Ping-pong by mailboxes in C, as `benches/local/src/harness/ping_pong.rs` plays it in Rust: the same messages and checks.
//
// Arguments: ping or pong, bytes, messages, warm-up, pause before each (ns), cap (ms), file for samples; directory of
// the node, blocking or spinning.

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "rohrpost.h"

#define NAME_PING ROHRPOST_NAME(1, 1, 0, 0)
#define NAME_PONG ROHRPOST_NAME(1, 2, 0, 0)
#define BYTES_MAX 65000
#define STOP UINT64_MAX
// As the bench's own turns: with fewer samples a turn goes on after its cap.
#define SAMPLES_MIN 50
// Longer than any message takes, so that a spinning receiver never sleeps.
#define SPIN_NS 100000000

static rohrpost_sender sender;
static rohrpost_receiver receiver;
static rohrpost_label label = {0, ROHRPOST_COMMAND(16), 0, 0, 0};
static bool spins;
static size_t bytes;

static void done(int32_t code, const char *what) {
    if (code != ROHRPOST_OK) {
        fprintf(stderr, "%s: %s\n", what, code < 0 ? rohrpost_last_error() : rohrpost_error_text(code));
        exit(1);
    }
}

static void fail(const char *what, uint64_t got, uint64_t due) {
    fprintf(stderr, "%s: %" PRIu64 ", not %" PRIu64 "\n", what, got, due);
    exit(1);
}

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000 + (uint64_t)now.tv_nsec;
}

// Waits until the other end has come as far.
static void meet(void) {
    puts("ready");
    fflush(stdout);
    if (getchar() == EOF) {
        fail("the bench has gone", 0, 0);
    }
}

static void fill(uint8_t *message, uint64_t number) {
    for (int at = 0; at < 8; at++) {
        message[at] = (uint8_t)(number >> (8 * at));
    }
    memset(message + 8, (uint8_t)number, bytes - 8);
}

static uint64_t number_of(const uint8_t *message) {
    uint64_t number = 0;
    for (int at = 0; at < 8; at++) {
        number |= (uint64_t)message[at] << (8 * at);
    }
    return number;
}

static void receive(uint8_t *message) {
    rohrpost_package package;
    if (spins) {
        done(rohrpost_receive_spinning(receiver, -1, SPIN_NS, &package), "receive");
    } else {
        done(rohrpost_receive(receiver, -1, &package), "receive");
    }
    if (package.len != bytes) {
        fail("length", package.len, bytes);
    }
    memcpy(message, package.body, bytes);
    done(rohrpost_receiver_release(receiver), "release");
}

static void send_message(const uint8_t *message) {
    done(rohrpost_send(sender, &label, message, bytes), "send");
}

// The far end has gone to sleep by then.
static void pause_for(uint64_t ns) {
    for (uint64_t began = now_ns(); ns > 0 && now_ns() - began < ns;) {
    }
}

static void ping(char **arguments) {
    uint64_t messages = strtoull(arguments[3], NULL, 10), warm_up = strtoull(arguments[4], NULL, 10);
    uint64_t pause_ns = strtoull(arguments[5], NULL, 10), cap_ns = strtoull(arguments[6], NULL, 10) * 1000000;
    const char *samples = arguments[7];
    static uint8_t message[BYTES_MAX], echo[BYTES_MAX];
    uint64_t *round_trips = calloc(messages, sizeof *round_trips);
    FILE *file = fopen(samples, "wb");
    if (round_trips == NULL || file == NULL) {
        perror(samples);
        exit(1);
    }
    // The far end waits for the first message by then.
    nanosleep(&(struct timespec){0, 10000000}, NULL);
    uint64_t began = now_ns(), least = messages < SAMPLES_MIN ? messages : SAMPLES_MIN, counted = 0;
    bool is_warm = warm_up == 0;
    for (uint64_t number = 0; number < warm_up + messages; number++) {
        fill(message, number);
        pause_for(pause_ns);
        uint64_t sent = now_ns();
        send_message(message);
        receive(echo);
        uint64_t back = now_ns();
        if (memcmp(message, echo, bytes) != 0) {
            fail("answer", number_of(echo), number);
        }
        if (is_warm && counted < messages) {
            round_trips[counted++] = back - sent;
        }
        uint64_t spent = back - began;
        is_warm = is_warm || number + 1 >= warm_up || spent > cap_ns / 4;
        if (spent > cap_ns && counted >= least) {
            break;
        }
    }
    fill(message, STOP);
    send_message(message);
    for (uint64_t at = 0; at < counted; at++) {
        uint8_t sample[8];
        for (int byte = 0; byte < 8; byte++) {
            sample[byte] = (uint8_t)(round_trips[at] >> (8 * byte));
        }
        fwrite(sample, 1, 8, file);
    }
    if (fclose(file) != 0) {
        perror(samples);
        exit(1);
    }
    free(round_trips);
}

static void pong(void) {
    static uint8_t message[BYTES_MAX];
    for (uint64_t expected = 0;; expected++) {
        receive(message);
        uint64_t number = number_of(message);
        if (number == STOP) {
            return;
        }
        if (number != expected) {
            fail("message", number, expected);
        }
        send_message(message);
    }
}

int main(int count, char **arguments) {
    if (count != 10) {
        fprintf(stderr, "nine arguments, not %d\n", count - 1);
        return 1;
    }
    bool is_ping = strcmp(arguments[1], "ping") == 0;
    bytes = strtoull(arguments[2], NULL, 10);
    spins = strcmp(arguments[9], "spinning") == 0;
    if (bytes < 16 || bytes > BYTES_MAX) {
        fail("bytes", bytes, BYTES_MAX);
    }
    uint32_t mine = is_ping ? NAME_PING : NAME_PONG, other = is_ping ? NAME_PONG : NAME_PING;
    rohrpost_node node;
    done(rohrpost_node_open_directory(arguments[8], true, mine, &node), "node");
    rohrpost_mailbox_shape shape = ROHRPOST_MAILBOX_DEFAULT;
    shape.body_bytes_max = (uint16_t)bytes;
    done(rohrpost_receiver_open(node, mine, &shape, &receiver), "mailbox");
    meet();
    done(rohrpost_sender_open(node, other, &sender), "sender");
    label.from = mine;
    meet();
    if (is_ping) {
        ping(arguments);
    } else {
        pong();
    }
    done(rohrpost_sender_close(sender), "closing");
    done(rohrpost_receiver_remove(receiver, NULL), "removing");
    return 0;
}
