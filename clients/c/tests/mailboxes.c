// Mailboxes, streams and waiting, used rightly and wrongly, in C11 and as C++. Its argument is a directory that it may
// make a node in.

#include "check.h"

#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>

static const rohrpost_label COMMAND = {0, ROHRPOST_COMMAND(16), 7, 100, 0};
static const rohrpost_label URGENT = {0, ROHRPOST_COMMAND(17), 8, 200, 0};
static const uint32_t OWN = ROHRPOST_NAME(1, 200, 0, 0);

static rohrpost_receiver receiver_at(rohrpost_node node, uint32_t name) {
    rohrpost_receiver receiver;
    DONE(rohrpost_receiver_open(node, name, NULL, &receiver));
    return receiver;
}

static rohrpost_sender sender_to(rohrpost_node node, uint32_t name) {
    rohrpost_sender sender;
    DONE(rohrpost_sender_open(node, name, &sender));
    return sender;
}

static void packages_come_in_order_of_priority_in_place(rohrpost_node node) {
    rohrpost_receiver receiver = receiver_at(node, OWN);
    rohrpost_sender sender = sender_to(node, OWN);
    rohrpost_package package;
    GIVES(ROHRPOST_NOTHING, rohrpost_receive(receiver, 0, &package));
    GIVES(ROHRPOST_NOTHING, rohrpost_receive(receiver, 1000000, &package));
    DONE(rohrpost_send(sender, &COMMAND, "later", 5));
    uint8_t *body;
    size_t room;
    DONE(rohrpost_loan(sender, 200, &body, &room));
    CHECK(room == 1024);
    GIVES(ROHRPOST_BUSY, rohrpost_send(sender, &COMMAND, "x", 1));
    GIVES(ROHRPOST_BUSY, rohrpost_loan(sender, 200, &body, &room));
    memcpy(body, "first", 5);
    DONE(rohrpost_loan_send(sender, &URGENT, 5));
    DONE(rohrpost_receive(receiver, -1, &package));
    CHECK(package.len == 5 && memcmp(package.body, "first", 5) == 0);
    CHECK(package.to == OWN && package.priority == 200 && package.kind == 17 && package.id == 8);
    DONE(rohrpost_receive_spinning(receiver, -1, 1000, &package));
    CHECK(package.len == 5 && memcmp(package.body, "later", 5) == 0 && package.published_ns > 0);
    DONE(rohrpost_receiver_release(receiver));
    DONE(rohrpost_loan(sender, 1, &body, &room));
    DONE(rohrpost_loan_drop(sender));
    GIVES(ROHRPOST_VALUE, rohrpost_loan_drop(sender));
    GIVES(ROHRPOST_VALUE, rohrpost_loan_send(sender, &COMMAND, 1));
    GIVES(ROHRPOST_NOTHING, rohrpost_receive(receiver, 0, &package));
    DONE(rohrpost_send(sender, &COMMAND, NULL, 0));
    DONE(rohrpost_loan(sender, 1, &body, &room));
    // Closed in another order than opened, with a loan and a package in hand.
    DONE(rohrpost_receive(receiver, 0, &package));
    DONE(rohrpost_sender_close(sender));
    size_t lost = 77;
    DONE(rohrpost_receiver_remove(receiver, &lost));
    CHECK(lost == 0);
}

static void mistakes_are_codes_with_words(rohrpost_node node) {
    rohrpost_sender sender;
    GIVES(ROHRPOST_NO_MAILBOX, rohrpost_sender_open(node, ROHRPOST_NAME(1, 99, 0, 0), &sender));
    SAYS("1.99.0.0");
    CHECK(sender.id == 0);
    GIVES(ROHRPOST_HANDLE, rohrpost_send(sender, &COMMAND, "x", 1));
    SAYS("no handle of a sender");
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_sender_open(node, OWN, NULL));
    SAYS("`sender`");
    rohrpost_mailbox_shape shape = ROHRPOST_MAILBOX_DEFAULT;
    rohrpost_receiver receiver, other;
    GIVES(ROHRPOST_VALUE, rohrpost_receiver_open(node, 0, &shape, &receiver));
    shape.overflow = 9;
    GIVES(ROHRPOST_VALUE, rohrpost_receiver_open(node, OWN, &shape, &receiver));
    shape.overflow = ROHRPOST_OVERFLOW_REJECT;
    shape.slots = 0;
    GIVES(ROHRPOST_VALUE, rohrpost_receiver_open(node, OWN, &shape, &receiver));
    shape.slots = 1;
    shape.body_bytes_max = 16;
    DONE(rohrpost_receiver_open(node, OWN, &shape, &receiver));
    GIVES(ROHRPOST_OWNED, rohrpost_receiver_open(node, OWN, &shape, &other));
    sender = sender_to(node, OWN);
    rohrpost_sender second;
    GIVES(ROHRPOST_CROWDED, rohrpost_sender_open(node, OWN, &second));
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_send(sender, &COMMAND, "more than sixteen", 17));
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_send(sender, &COMMAND, "x", SIZE_MAX));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_send(sender, &COMMAND, NULL, 1));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_send(sender, NULL, "x", 1));
    DONE(rohrpost_send(sender, &COMMAND, "x", 1));
    GIVES(ROHRPOST_FULL, rohrpost_send(sender, &URGENT, "x", 1));
    SAYS("1.200.0.0");
    rohrpost_package package;
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_receive(receiver, 0, NULL));
    // A handle of another kind, of nothing, and one that is closed.
    rohrpost_receiver wrong = {sender.id};
    GIVES(ROHRPOST_HANDLE, rohrpost_receive(wrong, 0, &package));
    wrong.id = receiver.id ^ 5;
    GIVES(ROHRPOST_CLOSED, rohrpost_receive(wrong, 0, &package));
    wrong.id = UINT64_MAX;
    GIVES(ROHRPOST_HANDLE, rohrpost_receive(wrong, 0, &package));
    // Of another kind than the sender at its place: it does no harm to that.
    const rohrpost_stream_writer forged = {(sender.id & ~((uint64_t)0xff << 16)) | (uint64_t)4 << 16};
    GIVES(ROHRPOST_CLOSED, rohrpost_stream_writer_close(forged));
    DONE(rohrpost_sender_close(sender));
    GIVES(ROHRPOST_CLOSED, rohrpost_sender_close(sender));
    sender = sender_to(node, OWN);
    uint8_t *body;
    size_t room;
    DONE(rohrpost_receive(receiver, 0, &package));
    DONE(rohrpost_receiver_release(receiver));
    DONE(rohrpost_loan(sender, 100, &body, &room));
    CHECK(room == 16);
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_loan_send(sender, &COMMAND, 17));
    DONE(rohrpost_sender_close(sender));
    DONE(rohrpost_receiver_remove(receiver, NULL));
    CHECK(strcmp(rohrpost_error_text(ROHRPOST_FULL), "the mailbox is full") == 0);
    CHECK(strcmp(rohrpost_error_text(12345), "not a code of Rohrpost") == 0);
}

static void nodes_and_names(rohrpost_node node, const char *directory) {
    rohrpost_node other;
    GIVES(ROHRPOST_NO_NODE, rohrpost_node_open_directory("/no/such/node", false, 0, &other));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_node_open_directory(NULL, false, 0, &other));
    GIVES(ROHRPOST_VALUE, rohrpost_node_open_directory("\xff", false, 0, &other));
    GIVES(ROHRPOST_CONFIGURATION, rohrpost_node_open(&other));
    SAYS("ROHRPOST_CONFIG");
    GIVES(ROHRPOST_CONFIGURATION, rohrpost_node_open_configured("/no/such.toml", NULL, NULL, &other));
    SAYS("/no/such.toml");
    // Twice: each takes a place of its own.
    DONE(rohrpost_node_open_directory(directory, false, 0, &other));
    uint32_t name;
    DONE(rohrpost_name_parse(other, "1.200.0.2", &name));
    CHECK(name == ROHRPOST_NAME(1, 200, 0, 2));
    GIVES(ROHRPOST_VALUE, rohrpost_name_parse(other, "motor.0", &name));
    char text[16];
    DONE(rohrpost_name_text(other, name, text, sizeof text));
    CHECK(strcmp(text, "1.200.0.2") == 0);
    GIVES(ROHRPOST_SMALL_BUFFER, rohrpost_name_text(other, name, text, 9));
    SAYS("10 are needed");
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_name_text(other, name, NULL, 9));
    rohrpost_time now;
    DONE(rohrpost_time_now(other, &now));
    CHECK(now.ns > 1500000000000000000u);
    CHECK(rohrpost_layout_version() > 0);
    DONE(rohrpost_node_close(other));
    GIVES(ROHRPOST_CLOSED, rohrpost_time_now(other, &now));
    (void)node;
}

static void streams_are_written_and_read_in_place(rohrpost_node node) {
    const rohrpost_stream id = {OWN, 1};
    rohrpost_stream_shape shape = {5000, 4, 2, 0};
    rohrpost_stream_writer writer;
    rohrpost_stream_reader reader;
    rohrpost_record record;
    DONE(rohrpost_stream_reader_open(node, id, &reader));
    GIVES(ROHRPOST_NOTHING, rohrpost_stream_next(reader, 0, &record, NULL));
    GIVES(ROHRPOST_NOTHING, rohrpost_stream_newest(reader, &record));
    DONE(rohrpost_stream_writer_open(node, id, &shape, &writer));
    uint8_t *body;
    size_t room;
    rohrpost_stamp at = {1, 1000};
    DONE(rohrpost_stream_begin(writer, at, &body, &room));
    CHECK(room == 5000);
    memset(body, 'a', room);
    GIVES(ROHRPOST_BUSY, rohrpost_stream_write(writer, at, "x", 1, NULL));
    GIVES(ROHRPOST_NOTHING, rohrpost_stream_next(reader, 0, &record, NULL));
    uint64_t sequence = 99;
    DONE(rohrpost_stream_finish(writer, 4096, &sequence));
    CHECK(sequence == 0);
    GIVES(ROHRPOST_VALUE, rohrpost_stream_finish(writer, 1, NULL));
    DONE(rohrpost_stream_next(reader, -1, &record, NULL));
    CHECK(record.len == 4096 && record.body[4095] == 'a' && record.about.stamp.ns == 1000);
    // What is in hand stays, however often the ring turns.
    for (at.ns = 1001; at.ns < 1010; at.ns++) {
        DONE(rohrpost_stream_write(writer, at, "newer", 5, &sequence));
    }
    CHECK(record.body[0] == 'a' && sequence == 9);
    uint64_t lost = 0;
    GIVES(ROHRPOST_LOST, rohrpost_stream_next(reader, 0, &record, &lost));
    CHECK(lost == 5);
    rohrpost_records_missed missed;
    DONE(rohrpost_stream_missed(reader, &missed));
    CHECK(missed.passed_over == 5 && missed.lost == 0 && missed.sampled == 0);
    DONE(rohrpost_stream_next(reader, 0, &record, &lost));
    CHECK(record.about.sequence == 6 && lost == 0 && memcmp(record.body, "newer", 5) == 0);
    DONE(rohrpost_stream_newest(reader, &record));
    CHECK(record.about.sequence == 9);
    rohrpost_records_around around;
    at.ns = 1008;
    // They do not take away what is in hand.
    const rohrpost_source source = {reader.id};
    GIVES(ROHRPOST_BUSY, rohrpost_source_idle(source));
    GIVES(ROHRPOST_BUSY, rohrpost_stream_around(reader, at, &around));
    GIVES(ROHRPOST_BUSY, rohrpost_stream_missed(reader, &missed));
    DONE(rohrpost_stream_reader_release(reader));
    DONE(rohrpost_source_idle(source));
    DONE(rohrpost_stream_around(reader, at, &around));
    CHECK(around.before.sequence == 8 && around.after.sequence == 8);
    DONE(rohrpost_stream_record(reader, 8, &record));
    CHECK(record.about.stamp.ns == 1008);
    GIVES(ROHRPOST_NOTHING, rohrpost_stream_record(reader, 1, &record));
    at.ns = 5000;
    GIVES(ROHRPOST_NOTHING, rohrpost_stream_around(reader, at, &around));
    SAYS("may still come");
    at.ns = 3;
    GIVES(ROHRPOST_LATE, rohrpost_stream_write(writer, at, "late", 4, NULL));
    at.ns = 0;
    GIVES(ROHRPOST_VALUE, rohrpost_stream_begin(writer, at, &body, &room));
    at.ns = 2000;
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_stream_write(writer, at, body, 5001, NULL));
    DONE(rohrpost_stream_begin(writer, at, &body, &room));
    DONE(rohrpost_stream_abandon(writer));
    GIVES(ROHRPOST_VALUE, rohrpost_stream_abandon(writer));
    DONE(rohrpost_stream_begin(writer, at, &body, &room));
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_stream_finish(writer, 5001, NULL));
    DONE(rohrpost_stream_reader_release(reader));
    rohrpost_stream_reader more[2];
    DONE(rohrpost_stream_reader_open(node, id, &more[0]));
    GIVES(ROHRPOST_CROWDED, rohrpost_stream_reader_open(node, id, &more[1]));
    rohrpost_stream_writer second;
    GIVES(ROHRPOST_OWNED, rohrpost_stream_writer_open(node, id, &shape, &second));
    DONE(rohrpost_stream_reader_close(more[0]));
    DONE(rohrpost_stream_writer_close(writer));
    GIVES(ROHRPOST_CLOSED, rohrpost_stream_write(writer, at, "x", 1, NULL));
    DONE(rohrpost_stream_reader_close(reader));
}

static void waits_for_mailboxes_streams_and_descriptors(rohrpost_node node) {
    rohrpost_receiver receiver = receiver_at(node, OWN);
    rohrpost_sender sender = sender_to(node, OWN);
    const rohrpost_stream id = {OWN, 2};
    rohrpost_stream_writer writer;
    rohrpost_stream_reader reader;
    DONE(rohrpost_stream_writer_open(node, id, NULL, &writer));
    DONE(rohrpost_stream_reader_open(node, id, &reader));
    rohrpost_source sources[3] = {{receiver.id}, {reader.id}, {0}};
    GIVES(ROHRPOST_NOTHING, rohrpost_wait(node, sources, 2, 1000000));
    GIVES(ROHRPOST_NOTHING, rohrpost_wait(node, NULL, 0, 1000000));
    // Not at all: it tells what is there already.
    GIVES(ROHRPOST_NOTHING, rohrpost_wait(node, sources, 2, 0));
    DONE(rohrpost_send(sender, &COMMAND, "x", 1));
    DONE(rohrpost_wait(node, sources, 2, 0));
    DONE(rohrpost_wait(node, sources, 2, -1));
    rohrpost_package package;
    DONE(rohrpost_receive(receiver, 0, &package));
    GIVES(ROHRPOST_BUSY, rohrpost_wait(node, sources, 2, -1));
    DONE(rohrpost_receiver_release(receiver));
    const rohrpost_stamp at = {1, 1};
    DONE(rohrpost_stream_write(writer, at, "r", 1, NULL));
    DONE(rohrpost_wait(node, sources, 2, 0));
    DONE(rohrpost_wait(node, sources, 2, -1));
    rohrpost_record record;
    DONE(rohrpost_stream_next(reader, 0, &record, NULL));
    DONE(rohrpost_stream_reader_release(reader));
    GIVES(ROHRPOST_HANDLE, rohrpost_wait(node, sources, 3, 0));
    sources[2] = sources[0];
    GIVES(ROHRPOST_VALUE, rohrpost_wait(node, sources, 3, 0));
    GIVES(ROHRPOST_TOO_LARGE, rohrpost_wait(node, sources, 65, 0));
    GIVES(ROHRPOST_NULL_POINTER, rohrpost_wait(node, NULL, 2, 0));
    int ends[2];
    CHECK(pipe(ends) == 0);
    uint32_t watch, none;
    rohrpost_ready ready;
    GIVES(ROHRPOST_NOTHING, rohrpost_next_ready(node, &ready));
    DONE(rohrpost_watch(node, ends[0], ROHRPOST_READ, &watch));
    GIVES(ROHRPOST_VALUE, rohrpost_watch(node, 9999, ROHRPOST_READ, &none));
    GIVES(ROHRPOST_VALUE, rohrpost_watch(node, -1, ROHRPOST_READ, &none));
    GIVES(ROHRPOST_VALUE, rohrpost_watch(node, ends[0], 0, &none));
    GIVES(ROHRPOST_NOTHING, rohrpost_wait(node, sources, 2, 0));
    CHECK(write(ends[1], "!", 1) == 1);
    DONE(rohrpost_wait(node, sources, 2, 0));
    DONE(rohrpost_wait(node, sources, 2, -1));
    DONE(rohrpost_next_ready(node, &ready));
    CHECK(ready.watch == watch && ready.readable && !ready.writable);
    GIVES(ROHRPOST_NOTHING, rohrpost_next_ready(node, &ready));
    DONE(rohrpost_unwatch(node, watch));
    GIVES(ROHRPOST_VALUE, rohrpost_unwatch(node, watch));
    CHECK(close(ends[0]) == 0 && close(ends[1]) == 0);
    DONE(rohrpost_stream_writer_close(writer));
    DONE(rohrpost_stream_reader_close(reader));
    DONE(rohrpost_sender_close(sender));
    DONE(rohrpost_receiver_remove(receiver, NULL));
}

struct shared {
    const char *directory;
    rohrpost_receiver receiver;
    const char *said;
};

static void *of_another_thread(void *argument) {
    const struct shared *shared = (const struct shared *)argument;
    rohrpost_package package;
    // Each thread has a place of its own, in which there is nothing yet.
    const char *said = rohrpost_last_error();
    CHECK(said != shared->said && *said == 0);
    GIVES(ROHRPOST_THREAD, rohrpost_receive(shared->receiver, 0, &package));
    SAYS("another thread");
    CHECK(rohrpost_last_error() == said);
    rohrpost_node node;
    DONE(rohrpost_node_open_directory(shared->directory, false, 0, &node));
    rohrpost_sender sender = sender_to(node, OWN);
    DONE(rohrpost_send(sender, &COMMAND, "from there", 10));
    // What is open is closed with the thread.
    return NULL;
}

static void handles_belong_to_their_thread_and_process(rohrpost_node node, const char *directory) {
    struct shared shared = {directory, receiver_at(node, OWN), rohrpost_last_error()};
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, of_another_thread, &shared) == 0);
    rohrpost_package package;
    DONE(rohrpost_receive(shared.receiver, -1, &package));
    CHECK(package.len == 10);
    CHECK(pthread_join(thread, NULL) == 0);
    pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        GIVES(ROHRPOST_FORKED, rohrpost_receive(shared.receiver, 0, &package));
        SAYS("forked");
        GIVES(ROHRPOST_FORKED, rohrpost_receiver_close(shared.receiver));
        rohrpost_node other;
        GIVES(ROHRPOST_FORKED, rohrpost_node_open_directory(directory, false, 0, &other));
        // With all that a program does at its end.
        exit(0);
    }
    int status;
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    // The child has given up nothing in this process's name.
    rohrpost_receiver second;
    GIVES(ROHRPOST_OWNED, rohrpost_receiver_open(node, OWN, NULL, &second));
    rohrpost_sender sender = sender_to(node, OWN);
    DONE(rohrpost_send(sender, &COMMAND, "still here", 10));
    DONE(rohrpost_receive(shared.receiver, -1, &package));
    CHECK(memcmp(package.body, "still here", 10) == 0);
}

// A failure that nobody can hear is one all the same: here nobody reads what the process says.
static void a_module_fails_in_order_that_nobody_hears(void) {
    pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        int ends[2];
        CHECK(pipe(ends) == 0 && dup2(ends[1], 2) == 2 && close(ends[0]) == 0);
        _exit(rohrpost_module_run(NULL, 0, NULL) == 1 ? 0 : 1);
    }
    int status;
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

int main(int count, char **arguments) {
    CHECK(count == 2);
    const char *directory = arguments[1];
    rohrpost_node node;
    DONE(rohrpost_node_open_directory(directory, true, OWN, &node));
    packages_come_in_order_of_priority_in_place(node);
    mistakes_are_codes_with_words(node);
    nodes_and_names(node, directory);
    streams_are_written_and_read_in_place(node);
    waits_for_mailboxes_streams_and_descriptors(node);
    handles_belong_to_their_thread_and_process(node, directory);
    a_module_fails_in_order_that_nobody_hears();
    // What is open is closed at the end.
    puts("all is well");
    return 0;
}
