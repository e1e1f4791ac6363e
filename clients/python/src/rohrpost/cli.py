"""The command ``python -m rohrpost``: what the tools of Rohrpost print, from anywhere."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any

from . import prints, remote
from .common import type_of_class
from .errors import FunctionError, RohrpostError
from .names import ALL_SYSTEMS, Installation, Name
from .remote.calling import NoSuchFunction, function_of
from .schema import (
    Description, Field, Type, WalkError, describe_field, describe_result, parse_argument, show, to_json,
)  # fmt: skip
from .prints import Wrong
from .schema.errors import plain
from .schema.tree import Option, is_word

_EPILOG = """examples:
  python -m rohrpost list --server robot.local --config robot.toml --digests COMMON-SYSTEM --as tool.64
  python -m rohrpost call motor.0 …            lists the functions and data of motor.0
  python -m rohrpost call motor.0.drive 0.3 0.5 …
  python -m rohrpost echo odometry.0.odometry --count 3 …
  python -m rohrpost stream read odometry.0 odometry --next 3 …
  python -m rohrpost picture camera.0 newest.png …
Arguments are numbers, words, or JSON. `rohrpost check FILE` prints the digests; a program of a system that no file
describes writes any number as the second. With --tls FOLDER NAME, FOLDER has ca.pem, NAME.pem and NAME.key.
"""


_BELOW_ZERO = re.compile(r"-((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|inf(inity)?|nan|0x[\da-f]+)$", re.IGNORECASE)
"""Numbers that are arguments of a function and no options."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs it; the exit code: 1 if the module answers with an error, 2 if there is none."""
    options = _parser().parse_args(arguments)
    try:
        with _connected(options) as client:
            code = int(options.run(client, options) or 0)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        return 1
    except FunctionError as error:
        print(plain(f"{options.what} answers with an error: {error}"), file=sys.stderr)
        return 1
    except (RohrpostError, Wrong, TimeoutError, ValueError, OSError, RuntimeError) as error:
        print(plain(str(error)), file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m rohrpost", description="Talks to the modules of a robot through its TCP router.",
        epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def add(name: str, run: Callable[[remote.Client, argparse.Namespace], int | None], text: str) -> Any:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run, what=name)
        _add_common(command)
        return command

    add("list", _list, "modules that take part at the TCP router, and their hosts")
    add("time", _time, "system time, and how far off it may be")
    status = add("status", _status, "how a module is")
    status.add_argument("what", metavar="NAME", help="module, such as motor.0")
    call = add("call", _call, "calls a function of a module; without a function, lists what it offers")
    call.add_argument("what", metavar="NAME.FUNCTION", help="such as motor.0.drive; or on, off, get.DATA")
    call.add_argument("values", metavar="ARGUMENT", nargs="*", help="its arguments")
    call._negative_number_matcher = _BELOW_ZERO
    echo = add("echo", _echo, "prints the data that a module publishes")
    echo.add_argument("what", metavar="NAME.DATA", help="such as odometry.0.odometry")
    echo.add_argument("--rate", type=float, default=0.0, metavar="HZ", help="at most so many a second; 0: all")
    echo.add_argument("--count", type=int, default=0, metavar="N", help="end after so many")
    stream = add("stream", prints.read_stream, "prints records of a stream that the robot's file sends here")
    stream.add_argument("action", choices=["read"], help="print the newest record, or the next ones")
    stream.add_argument("what", metavar="NAME", help="module, such as odometry.0")
    stream.add_argument("item", metavar="ITEM", help="stream, such as odometry")
    stream.add_argument("--next", type=int, default=0, metavar="N", help="so many, one after the other")
    stream.add_argument("--raw", metavar="FILE", help="write the bytes of records into this file")
    stream.add_argument("--bytes", type=int, default=64, metavar="N", help="bytes in JSON of a field of bytes; 0: all")
    picture = add("picture", prints.save_picture, "writes the newest picture of a camera into a file")
    picture.add_argument("what", metavar="NAME", help="module, such as camera.0")
    picture.add_argument("file", metavar="FILE", help="such as newest.png; of a camera that makes JPEG, newest.jpg")
    picture.add_argument("--item", default="image", metavar="ITEM", help="its stream (default: image)")
    return parser


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--server", required=True, metavar="HOST:PORT", help="the TCP router; the port is 21119 unless said"
    )
    parser.add_argument("--as", dest="own", default="tool.127", metavar="NAME", help="own name (default: tool.127)")
    parser.add_argument("--digests", metavar="HEX-HEX", help="as `rohrpost check` prints them")
    parser.add_argument("--config", metavar="FILE", help="the robot's file, for its classes (needs Python 3.11)")
    parser.add_argument("--class", dest="classes", action="append", default=[], metavar="NAME=ID", help="one class")
    parser.add_argument("--system", type=int, metavar="ID", help="own system (default: that of FILE, else 1)")
    parser.add_argument("--tls", nargs=2, metavar=("FOLDER", "NAME"), help="certificates, and the own one")
    parser.add_argument(
        "--label", default="python -m rohrpost", help="own name for people, `node NODE of SYSTEM` if the file has it"
    )
    parser.add_argument("--timeout", type=float, default=1.0, metavar="SECONDS", help="for an answer (default: 1)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def _installation(options: argparse.Namespace) -> Installation:
    classes: dict[str, int] = {}
    system = options.system
    if options.config:
        file = Installation.from_file(options.config, system)
        classes.update(file.classes)
        system = file.system
    for text in options.classes:
        name, _, number = text.partition("=")
        if not number.isdigit() or not 1 <= int(number) <= 255:
            raise Wrong(f"--class {text}: write name=id, such as motor=200")
        classes[name] = int(number)
    system = 1 if system is None else system
    if options.digests:
        return Installation.with_digests(system, options.digests, classes)
    if not options.config:
        raise Wrong(
            "--digests is needed (`rohrpost check` prints them), or --config for a system that no file describes"
        )
    return Installation.with_classes(system, classes)


def _connected(options: argparse.Namespace) -> remote.Client:
    tls = remote.Tls(*options.tls) if options.tls else None
    patience_s = max(5.0, options.timeout)
    return remote.connect(
        options.server, options.own, _installation(options), tls=tls, label=options.label, timeout_s=patience_s
    )


def _split(text: str) -> tuple[str, str]:
    """Module and what stands behind it: ``motor.0`` and ``drive`` of ``motor.0.drive``."""
    parts = text.split(".")
    size = 4 if parts[0].isdigit() and len(parts) >= 4 else 2
    if len(parts) < size:
        raise Wrong(f"`{text}` names no module; write class.instance, such as motor.0")
    return ".".join(parts[:size]), ".".join(parts[size:])


def _say(options: argparse.Namespace, type: Type, value: Any) -> None:
    print(json.dumps(to_json(type, value)) if options.json else "ok" if value is None else show(type, value))


def _list(client: remote.Client, options: argparse.Namespace) -> None:
    known = _installation(options)
    if "tcp" not in known.classes:
        raise Wrong("list needs the id of the class `tcp`: --config, or --class tcp=ID")
    router = Name.of(ALL_SYSTEMS, known.classes["tcp"], 255)
    _, hosts = client.get(router, "hosts", options.timeout)
    rows = [(_modules(known, host), host["client"]) for host in hosts["hosts"]]
    if options.json:
        print(json.dumps([{"modules": modules, "host": host} for modules, host in rows]))
        return
    width = max([len(modules) for modules, _ in rows], default=0)
    print(f"{len(rows) + hosts['more']} ranges of names take part")
    for modules, host in rows:
        print(f"{modules:{width}}  {plain(host)}")
    if hosts["more"]:
        print(f"and {hosts['more']} more")


def _modules(known: Installation, host: dict[str, Any]) -> str:
    first, last = Name(host["first"]).module, Name(host["last"]).module
    return known.text(first) if first == last else f"{known.text(first)} to {known.text(last)}"


def _time(client: remote.Client, options: argparse.Namespace) -> int:
    time = client.time()
    if time is None:
        print("the TCP router does not know system time", file=sys.stderr)
        return 1
    if options.json:
        print(json.dumps({"ns": time.ns, "error_ns": time.error_ns, "epoch": time.epoch}))
    else:
        print(f"{time.ns // 10**9}.{time.ns % 10**9:09} s since 1970, off by at most {time.error_ns / 1e6:.3f} ms")
    return 0


def _status(client: remote.Client, options: argparse.Namespace) -> int:
    status = client.status(options.what, options.timeout)
    if options.json:
        print(json.dumps(to_json(type_of_class(type(status)), status)))
    else:
        error = f": {plain(status.error)}" if status.error else ""
        print(f"{options.what} is {status.state.name.lower()}{error}")
        print(
            f"up {status.uptime_ms / 1000:.1f} s, {status.subscribers} subscribers, {status.missed} missed, "
            f"{status.lost} lost"
        )
    return 0


def _call(client: remote.Client, options: argparse.Namespace) -> None:
    module, name = _split(options.what)
    if name in ("on", "off") and not options.values:
        client.switch(module, name == "on", options.timeout)
        print("null" if options.json else "ok")
        return
    description = client.describe(module, options.timeout)
    if not name:
        print(_listing(description))
        return
    if name.startswith("get.") and not options.values:
        item = description.data_item(name[4:])
        _, value = client.get(module, name[4:], options.timeout)
        assert item is not None, "`get` found it"
        return _say(options, item.field.type, value)
    function = function_of(client.name(module), description, name)
    if len(options.values) != len(function.arguments):
        raise Wrong(f"`{name}` takes {', '.join(map(describe_field, function.arguments)) or 'nothing'}")
    values = [_value(field, text) for field, text in zip(function.arguments, options.values)]
    result = client.call(module, name, *values, timeout_s=options.timeout)
    _say(options, _ok_type(function.result), result)


def _ok_type(type: Type) -> Type:
    from .schema import Enum, is_result

    if is_result(type):
        assert isinstance(type, Enum)
        return type.variants[0].fields[0].type
    return type


def _value(field: Field, text: str) -> Any:
    try:
        type = field.type if text[:1] == '"' else _some_of(field.type)
        if text[:1] in ("{", "[", '"') and not is_word(type):
            return json.loads(text)
        return parse_argument(field.type, text)
    except WalkError as error:
        raise Wrong(str(error.within(field.name))) from None
    except (ValueError, RecursionError) as error:
        raise Wrong(f"{plain(field.name)}: no JSON: {error}") from None


def _some_of(type: Type) -> Type:
    """The type behind options."""
    return _some_of(type.inner) if isinstance(type, Option) else type


def _listing(description: Description) -> str:
    lines = [f"class {plain(description.klass)}: {plain(description.text)}"]
    if description.functions:
        lines += ["", "functions"]
    for function in description.functions:
        arguments = "".join(f" <{describe_field(field)}>" for field in function.arguments)
        lines.append(f"  {plain(function.name)}{arguments} -> {describe_result(function.result)}")
        lines += [f"      {plain(function.text)}"] if function.text else []
    if description.data:
        lines += ["", "data"]
    for item in description.data:
        lines.append(f"  {describe_field(item.field)}")
        lines += [f"      {plain(item.field.text)}"] if item.field.text else []
    return "\n".join([*lines, "", "every module: on, off, get.DATA"])


def _echo(client: remote.Client, options: argparse.Namespace) -> None:
    module, name = _split(options.what)
    description = client.describe(module, options.timeout)
    item = description.data_item(name) if name else description.data[0] if len(description.data) == 1 else None
    if item is None:
        names = ", ".join(plain(it.name) for it in description.data)
        raise NoSuchFunction(f"{module}: no data `{plain(name)}`; it has: {names or 'none'}")
    period_s = 1.0 / options.rate if options.rate > 0 else 0.0
    count = 0
    for data in client.subscribe(module, item.name, period_s=period_s):
        if options.json:
            value = to_json(item.field.type, data.value)
            told = {"time_ns": data.time_ns, "sequence": data.sequence, "missed": data.missed, "value": value}
            print(json.dumps(told), flush=True)
        else:
            stamp = f"{data.time_ns // 10**9}.{data.time_ns % 10**9:09}"
            print(f"{stamp} #{data.sequence} {show(item.field.type, data.value)}", flush=True)
        count += 1
        if count == options.count:
            return
