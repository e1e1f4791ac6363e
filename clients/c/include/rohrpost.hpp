// Rohrpost for C++17: thin wrappers around rohrpost.h that close what they open, and throw what fails.
//
// A handle belongs to the thread that opened it, so does its wrapper: it must be destroyed there. A package or record
// in hand is given back by its own destructor, in the same thread and before that of its receiver or reader; while one
// is in hand, its receiver or reader refuses (`ROHRPOST_BUSY`) to hand out another one.

#ifndef ROHRPOST_HPP
#define ROHRPOST_HPP

#include "rohrpost.h"

#include <chrono>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rohrpost {

// Why a call failed.
class Error : public std::runtime_error {
public:
    explicit Error(rohrpost_code code) : std::runtime_error(rohrpost_last_error()), code_(code) {}

    rohrpost_code code() const noexcept { return code_; }

private:
    rohrpost_code code_;
};

// Throws if a call has failed; false if there is nothing.
inline bool check(rohrpost_code code) {
    if (code < 0) {
        throw Error(code);
    }
    return code == ROHRPOST_OK;
}

// What is in hand, until this is gone.
template <class Value, class Handle, rohrpost_code (*release)(Handle)>
class InHand {
public:
    InHand(Value value, Handle handle) : value_(value), handle_(handle) {}
    InHand(InHand &&other) noexcept : value_(other.value_), handle_(std::exchange(other.handle_, Handle{0})) {}
    InHand(const InHand &) = delete;
    InHand &operator=(const InHand &) = delete;
    InHand &operator=(InHand &&) = delete;
    ~InHand() {
        if (handle_.id != 0) {
            release(handle_);
        }
    }

    const Value &operator*() const noexcept { return value_; }
    const Value *operator->() const noexcept { return &value_; }

private:
    Value value_;
    Handle handle_;
};

// A handle that is closed with this.
template <class Handle, rohrpost_code (*close)(Handle)>
class Owned {
public:
    Owned(Owned &&other) noexcept : handle_(std::exchange(other.handle_, Handle{0})) {}
    Owned &operator=(Owned &&other) noexcept {
        std::swap(handle_, other.handle_);
        return *this;
    }
    Owned(const Owned &) = delete;
    Owned &operator=(const Owned &) = delete;
    ~Owned() {
        if (handle_.id != 0) {
            close(handle_);
        }
    }

    // For calls of rohrpost.h.
    Handle handle() const noexcept { return handle_; }

protected:
    Owned() = default;

    Handle handle_{0};
};

// A node that this thread takes part in.
class Node : public Owned<rohrpost_node, rohrpost_node_close> {
public:
    // That on which launch has started this process.
    Node() { check(rohrpost_node_open(&handle_)); }

    // By its directory.
    explicit Node(const char *directory, bool create = false, uint32_t module = 0) {
        check(rohrpost_node_open_directory(directory, create, module, &handle_));
    }

    uint32_t name(const char *text) const {
        uint32_t name;
        check(rohrpost_name_parse(handle_, text, &name));
        return name;
    }

    rohrpost_time now() const {
        rohrpost_time now;
        check(rohrpost_time_now(handle_, &now));
        return now;
    }

    // Waits for receivers and readers; false if the time has passed.
    bool wait(const std::vector<rohrpost_source> &sources, int64_t timeout_ns = -1) const {
        return check(rohrpost_wait(handle_, sources.data(), sources.size(), timeout_ns));
    }
};

// A way into one mailbox.
class Sender : public Owned<rohrpost_sender, rohrpost_sender_close> {
public:
    Sender(const Node &node, uint32_t name) { check(rohrpost_sender_open(node.handle(), name, &handle_)); }

    void send(const rohrpost_label &label, std::string_view body) {
        check(rohrpost_send(handle_, &label, body.data(), body.size()));
    }

    // Writes in place: `write` fills the slot, and says how many bytes it has written. If it throws, nothing is sent.
    template <class Write>
    void send_in_place(const rohrpost_label &label, Write write) {
        uint8_t *body;
        size_t room;
        check(rohrpost_loan(handle_, label.priority, &body, &room));
        size_t len;
        try {
            len = write(body, room);
        } catch (...) {
            rohrpost_loan_drop(handle_);
            throw;
        }
        check(rohrpost_loan_send(handle_, &label, len));
    }
};

// The receiving end of a mailbox.
class Receiver : public Owned<rohrpost_receiver, rohrpost_receiver_close> {
public:
    using Package = InHand<rohrpost_package, rohrpost_receiver, rohrpost_receiver_release>;

    Receiver(const Node &node, uint32_t name, const rohrpost_mailbox_shape *shape = nullptr) {
        check(rohrpost_receiver_open(node.handle(), name, shape, &handle_));
    }

    // None if the time has passed. One at a time.
    std::optional<Package> receive(int64_t timeout_ns = -1) {
        rohrpost_package package;
        check(rohrpost_source_idle(source()));
        if (!check(rohrpost_receive(handle_, timeout_ns, &package))) {
            return std::nullopt;
        }
        return std::optional<Package>(std::in_place, package, handle_);
    }

    // Closes it and removes its mailbox; how many packages waited there.
    size_t remove() {
        size_t lost;
        check(rohrpost_receiver_remove(handle_, &lost));
        handle_ = rohrpost_receiver{0};
        return lost;
    }

    rohrpost_source source() const noexcept { return {handle_.id}; }
};

// The one writer of a stream.
class StreamWriter : public Owned<rohrpost_stream_writer, rohrpost_stream_writer_close> {
public:
    StreamWriter(const Node &node, rohrpost_stream stream, const rohrpost_stream_shape *shape = nullptr) {
        check(rohrpost_stream_writer_open(node.handle(), stream, shape, &handle_));
    }

    // The number of the record.
    uint64_t write(rohrpost_stamp at, std::string_view body) {
        uint64_t sequence;
        check(rohrpost_stream_write(handle_, at, body.data(), body.size(), &sequence));
        return sequence;
    }

    // Writes in place, as `Sender::send_in_place`.
    template <class Write>
    uint64_t write_in_place(rohrpost_stamp at, Write write) {
        uint8_t *body;
        size_t room;
        check(rohrpost_stream_begin(handle_, at, &body, &room));
        size_t len;
        try {
            len = write(body, room);
        } catch (...) {
            rohrpost_stream_abandon(handle_);
            throw;
        }
        uint64_t sequence;
        check(rohrpost_stream_finish(handle_, len, &sequence));
        return sequence;
    }
};

// One of a stream's readers.
class StreamReader : public Owned<rohrpost_stream_reader, rohrpost_stream_reader_close> {
public:
    using Record = InHand<rohrpost_record, rohrpost_stream_reader, rohrpost_stream_reader_release>;

    StreamReader(const Node &node, rohrpost_stream stream) {
        check(rohrpost_stream_reader_open(node.handle(), stream, &handle_));
    }

    // The next record that is there; none if the time has passed. What was lost before it is in `missed`. One at a
    // time.
    std::optional<Record> next(int64_t timeout_ns = -1) {
        rohrpost_record record;
        rohrpost_code code;
        check(rohrpost_source_idle(source()));
        const auto began = std::chrono::steady_clock::now();
        int64_t left_ns = timeout_ns;
        while ((code = rohrpost_stream_next(handle_, left_ns, &record, nullptr)) == ROHRPOST_LOST) {
            if (timeout_ns > 0) {
                const std::chrono::nanoseconds passed = std::chrono::steady_clock::now() - began;
                left_ns = passed.count() < timeout_ns ? timeout_ns - passed.count() : 0;
            }
        }
        return in_hand(code, record);
    }

    // The newest record; none before the first.
    std::optional<Record> newest() {
        rohrpost_record record;
        check(rohrpost_source_idle(source()));
        return in_hand(rohrpost_stream_newest(handle_, &record), record);
    }

    rohrpost_records_missed missed() {
        rohrpost_records_missed missed;
        check(rohrpost_stream_missed(handle_, &missed));
        return missed;
    }

    rohrpost_source source() const noexcept { return {handle_.id}; }

private:
    std::optional<Record> in_hand(rohrpost_code code, const rohrpost_record &record) {
        if (!check(code)) {
            return std::nullopt;
        }
        return std::optional<Record>(std::in_place, record, handle_);
    }
};

// A module: override what it does, and `run` it in `main`. What is thrown is why it failed.
class Module {
public:
    virtual ~Module() = default;

    virtual void made() {}
    virtual void on() {}
    virtual void off() {}
    virtual void tick() {}
    // False if there is no such function.
    virtual bool command(uint16_t, rohrpost_decoder &, rohrpost_encoder &) { return false; }
    virtual void received(const rohrpost_followed &) {}
    virtual void ready(const rohrpost_ready &) {}
    virtual void parameters_changed(const std::vector<std::string_view> &) {}

    // Until it is told to end; the exit code of the process.
    int run(const rohrpost_interface &interface, int count, char **arguments,
        const std::vector<rohrpost_parameter> &parameters = {}) {
        rohrpost_module table{};
        table.interface = &interface;
        table.parameters = parameters.data();
        table.parameter_count = parameters.size();
        table.user = this;
        table.made = [](void *user) { return caught(user, [](Module &module) { module.made(); }); };
        table.on = [](void *user) { return caught(user, [](Module &module) { module.on(); }); };
        table.off = [](void *user) { caught(user, [](Module &module) { module.off(); }); };
        table.tick = [](void *user) { return caught(user, [](Module &module) { module.tick(); }); };
        table.command = [](void *user, uint16_t number, rohrpost_decoder *given, rohrpost_encoder *reply) {
            bool is_there = false;
            rohrpost_outcome outcome = caught(
                user, [&](Module &module) { is_there = module.command(number, *given, *reply); });
            return outcome < 0 || is_there ? outcome : rohrpost_outcome{ROHRPOST_NO_ITEM};
        };
        table.received = [](void *user, const rohrpost_followed *data) {
            return caught(user, [&](Module &module) { module.received(*data); });
        };
        table.ready = [](void *user, const rohrpost_ready *ready) {
            return caught(user, [&](Module &module) { module.ready(*ready); });
        };
        table.parameters_changed = [](void *user, const char *const *names, size_t changed) {
            return caught(user, [&](Module &module) { module.parameters_changed({names, names + changed}); });
        };
        return rohrpost_module_run(&table, count, const_cast<const char *const *>(arguments));
    }

private:
    template <class Function>
    static rohrpost_outcome caught(void *user, Function function) noexcept {
        try {
            function(*static_cast<Module *>(user));
            return ROHRPOST_OK;
        } catch (const Error &error) {
            rohrpost_fail(error.what());
            return error.code();
        } catch (const std::exception &error) {
            return rohrpost_fail(error.what());
        } catch (...) {
            return rohrpost_fail("an exception without words");
        }
    }
};

} // namespace rohrpost

#endif // ROHRPOST_HPP
