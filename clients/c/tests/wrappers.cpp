// The wrappers of C++17. Its argument is a directory that it may make a node in.

#include "rohrpost.hpp"

#include "check.h"

#include <thread>

namespace {

constexpr uint32_t OWN = ROHRPOST_NAME(1, 200, 0, 0);
const rohrpost_label LABEL = {0, ROHRPOST_COMMAND(16), 1, 100, 0};

// A failure is an exception with its code and words.
template <class Call>
void throws(rohrpost_code code, Call call) {
    try {
        call();
    } catch (const rohrpost::Error &error) {
        CHECK(error.code() == code && error.what()[0] != '\0');
        return;
    }
    CHECK(!"it throws");
}

} // namespace

int main(int, char **arguments) {
    rohrpost::Node node(arguments[1], true, OWN);
    throws(ROHRPOST_NO_NODE, [] { rohrpost::Node("/no/such/node"); });
    throws(ROHRPOST_NO_MAILBOX, [&] { rohrpost::Sender(node, OWN); });
    CHECK(node.name("1.200.0.0") == OWN && node.now().ns > 0);

    rohrpost::Receiver receiver(node, OWN);
    throws(ROHRPOST_OWNED, [&] { rohrpost::Receiver(node, OWN); });
    rohrpost::Sender sender(node, OWN);
    CHECK(!receiver.receive(0));
    sender.send(LABEL, "copied");
    sender.send_in_place(LABEL, [](uint8_t *body, size_t) { memcpy(body, "placed", 6); return size_t{6}; });
    CHECK(node.wait({receiver.source()}));
    {
        auto package = receiver.receive();
        CHECK(package && (*package)->len == 6 && memcmp((*package)->body, "copied", 6) == 0);
        throws(ROHRPOST_BUSY, [&] { node.wait({receiver.source()}); });
        throws(ROHRPOST_BUSY, [&] { receiver.receive(0); });
        CHECK(memcmp((*package)->body, "copied", 6) == 0);
    }
    // The package was released with its wrapper.
    CHECK(node.wait({receiver.source()}));
    CHECK(memcmp((*receiver.receive())->body, "placed", 6) == 0);
    try {
        sender.send_in_place(LABEL, [](uint8_t *, size_t) -> size_t { throw std::runtime_error("never sent"); });
        CHECK(!"it throws");
    } catch (const std::runtime_error &) {
    }
    sender.send(LABEL, "left");
    rohrpost::Sender moved = std::move(sender);
    throws(ROHRPOST_HANDLE, [&] { sender.send(LABEL, "x"); });
    // In another thread nothing happens, and it can still be removed here.
    std::thread([&] { throws(ROHRPOST_THREAD, [&] { receiver.remove(); }); }).join();
    CHECK(receiver.remove() == 1);

    const rohrpost_stream stream = {OWN, 1};
    rohrpost::StreamReader reader(node, stream);
    rohrpost::StreamWriter writer(node, stream);
    CHECK(!reader.newest() && !reader.next(0));
    CHECK(writer.write({1, 1}, "first") == 0);
    CHECK(writer.write_in_place({1, 2}, [](uint8_t *body, size_t) { body[0] = '2'; return size_t{1}; }) == 1);
    {
        auto first = reader.next();
        CHECK((*first)->len == 5);
        // It is whole until its wrapper is gone: nothing takes it away.
        throws(ROHRPOST_BUSY, [&] { reader.next(0); });
        throws(ROHRPOST_BUSY, [&] { reader.newest(); });
        throws(ROHRPOST_BUSY, [&] { reader.missed(); });
        CHECK(memcmp((*first)->body, "first", 5) == 0);
    }
    CHECK((*reader.next())->about.sequence == 1);
    CHECK((*reader.newest())->body[0] == '2');
    for (uint64_t ns = 3; ns < 103; ns++) {
        writer.write({1, ns}, "more");
    }
    CHECK((*reader.next())->about.stamp.ns == 39);
    CHECK(reader.missed().passed_over == 36);
    throws(ROHRPOST_LATE, [&] { writer.write({1, 1}, "late"); });
    puts("all is well");
    return 0;
}
