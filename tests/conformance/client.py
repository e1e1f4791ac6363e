"""The client in Python under the conformance suite: answers the questions of the line protocol with the package.
``--asyncio``: the client for asyncio takes part at the TCP router."""

import concurrent.futures
import json

import pathlib
import sys

PACKAGE = pathlib.Path(__file__).parents[2] / "clients" / "python"
sys.path[:0] = [str(PACKAGE / "src"), str(PACKAGE / "tests")]

import in_loop  # noqa: E402
import rohrpost as rp  # noqa: E402
from rohrpost import remote, schema, wire  # noqa: E402
from rohrpost.faults import Fault  # noqa: E402
from rohrpost.names import Name  # noqa: E402


def fields(head):
    return {
        "to": head.to, "from": head.sender, "len": head.length, "type": head.kind, "id": head.id,
        "priority": head.priority, "options": head.options,
    }  # fmt: skip


def head(ask):
    data = bytes.fromhex(ask["bytes"])
    read = wire.Head.from_bytes(data)
    assert read.to_bytes() == data, "a head that is written as it was read is the same"
    return fields(read)


def package(ask):
    data = bytes.fromhex(ask["bytes"])
    read = wire.Head.from_bytes(data)
    kind = wire.CallEnvelope if read.is_command else wire.ReplyEnvelope if read.data_number is None else wire.DataHead
    envelope, rest = kind.split(data[wire.HEAD_BYTES :])
    assert envelope.to_bytes() + rest == data[wire.HEAD_BYTES :]
    return {"head": fields(read), "envelope": list(vars(envelope).values()), "rest": rest.hex()}


def decode(ask):
    type = schema.type_from_bytes(bytes.fromhex(ask["type"]))
    return schema.to_json(type, schema.decode(type, bytes.fromhex(ask["bytes"])))


def encode(ask):
    type = schema.type_from_bytes(bytes.fromhex(ask["type"]))
    return schema.encode(type, ask["value"]).hex()


def interface(ask):
    its = schema.Description.from_bytes(bytes.fromhex(ask["bytes"]))
    return {"name": its.name, "class": its.klass, "hash": its.hash, "again": its.to_bytes().hex()}


def type_(ask):
    type = schema.type_from_bytes(bytes.fromhex(ask["bytes"]))
    return {"hash": schema.type_hash(type), "again": schema.type_to_bytes(type).hex()}


def fault(ask):
    its = Fault.from_bytes(bytes.fromhex(ask["bytes"]))
    assert its.to_bytes().hex() == ask["bytes"]
    return {"number": its.number, "one_try": its.is_of_one_try, "words": str(its)}


class Probing(rp.Module, klass="probe"):
    counted = again_counted = beats = 0

    @rp.command(16)
    def double(self, number: rp.U32) -> rp.U64:
        return 2 * number

    @rp.command(17)
    def count(self) -> rp.U64:
        self.counted += 1
        return self.counted

    @rp.command(18, error=str)
    def refuse(self, why: str) -> rp.U32:
        raise rp.FunctionError(why)

    @rp.command(19, idempotent=True)
    def again(self) -> rp.U64:
        self.again_counted += 1
        return self.again_counted

    @rp.data_out(1, rate_hz=20)
    def beat(self) -> rp.U64:
        self.beats += 1
        return self.beats


class Live:
    """What talks to a TCP router."""

    def __init__(self):
        self.client, self.begun = None, []
        self.threads = concurrent.futures.ThreadPoolExecutor(8)

    def connect(self, ask):
        own = Name.parse(ask["own"])
        installation = remote.Installation.with_digests(own.system, ask["digests"])
        big_endian = ask["order"] == "big"
        connect = in_loop.connect if "--asyncio" in sys.argv else remote.connect
        self.client = connect(ask["server"], own, installation, big_endian=big_endian, timeout_s=20)
        self.client.host(own, Probing())
        return True

    def close(self, ask):
        self.client.close()
        return True

    def call(self, ask):
        arguments = bytes.fromhex(ask["arguments"])
        timeout_s = ask["timeout_ms"] / 1000
        try:
            result = self.client.command(Name.parse(ask["to"]), ask["function"], ask["interface"], arguments, timeout_s)
            return {"result": result.hex()}
        except rp.CallTimeout:
            return {"timeout": True}
        except rp.CallFault as error:
            return {"fault": error.fault.number}

    def begin(self, ask):
        self.begun.append(self.threads.submit(self.call, ask))

    def wait(self, ask):
        return self.begun.pop(0).result()

    def follow(self, ask):
        with self.client.subscribe(Name.parse(ask["to"]), ask["data"]) as subscription:
            values = [subscription.next(20) for _ in range(ask["count"])]
        return [[it.sequence, schema.encode(subscription.type, it.value).hex()] for it in values]

    def time(self, ask):
        time = self.client.time()
        return {"ns": time.ns, "error_ns": time.error_ns, "epoch": time.epoch}


LIVE = Live()
ANSWERS = {
    "name": lambda ask: Name.parse(ask["text"]).raw, "head": head, "decode": decode, "encode": encode,
    "interface": interface, "type": type_, "package": package, "fault": fault, "connect": LIVE.connect,
    "close": LIVE.close, "call": LIVE.call, "wait": LIVE.wait, "follow": LIVE.follow, "time": LIVE.time,
}  # fmt: skip


def main():
    for line in sys.stdin:
        ask = json.loads(line)
        if ask["do"] == "begin":
            LIVE.begin(ask)
            continue
        try:
            answer = {"ok": ANSWERS[ask["do"]](ask)}
        except (ValueError, KeyError, rp.RohrpostError) as error:
            answer = {"error": str(error)}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
