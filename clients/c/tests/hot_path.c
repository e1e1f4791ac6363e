// What is done with each package and record takes nothing from the heap, also when it is refused. Its argument is a
// directory that it may make a node in.

#include "check.h"

// All that this program and the library take from the heap comes by here.
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *there, size_t size);
static size_t taken;

void *malloc(size_t size) {
    taken += 1;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    taken += 1;
    return __libc_calloc(count, size);
}

void *realloc(void *there, size_t size) {
    taken += 1;
    return __libc_realloc(there, size);
}

int main(int count, char **arguments) {
    CHECK(count == 2);
    const uint32_t own = ROHRPOST_NAME(1, 200, 0, 0);
    const rohrpost_label label = {0, ROHRPOST_COMMAND(16), 7, 100, 0};
    const rohrpost_mailbox_shape shape = {2, 64, ROHRPOST_OVERFLOW_REJECT, 1, 0};
    const rohrpost_stream stream = {own, 1};
    const rohrpost_stream_shape ring = {5000, 4, 2, 0};
    rohrpost_node node;
    rohrpost_receiver receiver;
    rohrpost_sender sender;
    rohrpost_stream_writer writer;
    rohrpost_stream_reader reader;
    DONE(rohrpost_node_open_directory(arguments[1], true, own, &node));
    DONE(rohrpost_receiver_open(node, own, &shape, &receiver));
    DONE(rohrpost_sender_open(node, own, &sender));
    DONE(rohrpost_stream_writer_open(node, stream, &ring, &writer));
    DONE(rohrpost_stream_reader_open(node, stream, &reader));
    const rohrpost_source sources[] = {{receiver.id}, {reader.id}};
    size_t before = 0;
    CHECK(taken > 0);
    for (uint64_t round = 1; round <= 1000; round++) {
        // The first rounds may still prepare something.
        if (round == 10) {
            before = taken;
        }
        uint8_t *body;
        size_t room;
        rohrpost_package package;
        rohrpost_record record;
        const rohrpost_stamp at = {1, round};
        DONE(rohrpost_send(sender, &label, "copied", 6));
        DONE(rohrpost_loan(sender, 100, &body, &room));
        body[0] = (uint8_t)round;
        DONE(rohrpost_loan_send(sender, &label, 1));
        GIVES(ROHRPOST_FULL, rohrpost_send(sender, &label, "refused", 7));
        DONE(rohrpost_stream_begin(writer, at, &body, &room));
        body[0] = (uint8_t)round;
        DONE(rohrpost_stream_finish(writer, 1, NULL));
        DONE(rohrpost_wait(node, sources, 2, -1));
        DONE(rohrpost_receive(receiver, -1, &package));
        DONE(rohrpost_receive_spinning(receiver, -1, 1000, &package));
        CHECK(package.body[0] == (uint8_t)round);
        DONE(rohrpost_receiver_release(receiver));
        DONE(rohrpost_stream_next(reader, -1, &record, NULL));
        CHECK(record.body[0] == (uint8_t)round);
        DONE(rohrpost_stream_reader_release(reader));
        GIVES(ROHRPOST_NOTHING, rohrpost_wait(node, sources, 2, 1));
    }
    CHECK(taken == before);
    // However often a place is used again, an old handle leads to nobody else's sender.
    const rohrpost_sender old = sender;
    DONE(rohrpost_sender_close(sender));
    for (int round = 0; round < 65535; round++) {
        DONE(rohrpost_sender_open(node, own, &sender));
        DONE(rohrpost_sender_close(sender));
    }
    DONE(rohrpost_sender_open(node, own, &sender));
    CHECK(sender.id != old.id);
    GIVES(ROHRPOST_CLOSED, rohrpost_send(old, &label, "x", 1));
    puts("all is well");
    return 0;
}
