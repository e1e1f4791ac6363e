"""``python -m rohrpost``: what it prints begins with the result, and nothing of others reaches the terminal."""

from __future__ import annotations

import contextlib
import io
import json
import unittest
from typing import Annotated

import rohrpost as rp
from rohrpost import remote
from rohrpost.schema.errors import plain
from rohrpost.cli import main

from .modules import INSTALLATION
from .router import Server

EVIL = "\x1b[2J\x1b]0;owned\x07\r\u202eevil\x9b31m"


@rp.data(name=EVIL)
class Said:
    """Words."""

    words: Annotated[str, rp.said(unit=EVIL, text=EVIL)]


class Evil(rp.Module, klass=EVIL, interface=EVIL):
    __doc__ = EVIL

    @rp.command(16)
    def echo(self, words: Annotated[str, rp.said(unit=EVIL)]) -> Said:
        """Says it again."""
        return Said(words + EVIL)

    @rp.command(17, error=str)
    def refuse(self) -> None:
        raise rp.FunctionError(EVIL)

    @rp.command(18)
    def fail(self) -> None:
        raise RuntimeError(EVIL)

    @rp.data_out(1, rate_hz=50)
    def word(self) -> Said:
        return Said(EVIL)


class Command(unittest.TestCase):
    def setUp(self) -> None:
        server = Server()
        self.addCleanup(server.close)
        client = remote.connect(server.address, "probe.0", INSTALLATION, timeout_s=20)
        self.addCleanup(client.close)
        client.host("probe.0", Evil())
        self.options = [
            "--server", server.address, "--digests", f"{7:016x}-{1:016x}", "--system", "7", "--class", "probe=96",
            "--class", "tool=16", "--timeout", "20",
        ]  # fmt: skip

    def say(self, *words: str) -> tuple[int, str, str]:
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main([*words, *self.options])
        said = out.getvalue(), err.getvalue()
        for line in "".join(said).splitlines():
            self.assertTrue(line.isprintable(), repr(line))
        return code, *said

    def test_results_stand_first_and_errors_have_exit_codes(self) -> None:
        evil = '"' + plain("x" + EVIL) + '"'
        self.assertEqual(self.say("call", "probe.0.echo", "x"), (0, f"{{words: {evil}}}\n", ""))
        code, out, _ = self.say("call", "probe.0.echo", "x", "--json")
        self.assertEqual((code, json.loads(out)), (0, {"words": "x" + EVIL}))
        code, out, err = self.say("call", "probe.0.refuse")
        self.assertEqual((code, out), (1, ""))
        self.assertTrue(err.startswith("probe.0.refuse answers with an error: "), err)
        code, out, _ = self.say("call", "probe.0")
        self.assertTrue(code == 0 and "Says it again." in out, out)
        code, out, _ = self.say("echo", "probe.0.word", "--count", "2")
        self.assertTrue(code == 0 and len(out.splitlines()) == 2, out)
        code, out, _ = self.say("time")
        self.assertTrue(code == 0 and out[0].isdigit(), out)
        code, _, err = self.say("call", "probe.0.fail")
        self.assertTrue(code == 2 and "the module is in error: RuntimeError: " in err, err)
        code, out, _ = self.say("status", "probe.0")
        self.assertTrue(code == 0 and out.startswith("probe.0 is error: RuntimeError: "), out)

    def test_numbers_below_zero_and_texts_that_begin_as_json_are_arguments(self) -> None:
        for word in ("-1e-3", "-.5", "-inf", "-5.", "-0x1f", "-1", "-NaN", "[x", "{x}", '"x'):
            shown = '"' + plain(word + EVIL).replace('"', '\\"') + '"'
            self.assertEqual(self.say("call", "probe.0.echo", word), (0, f"{{words: {shown}}}\n", ""), word)

    def test_what_cannot_be_meant_is_told(self) -> None:
        for words, why in [
            (("call", "probe"), "`probe` names no module; write class.instance, such as motor.0"),
            (("call", "probe.0.echo"), "`echo` takes words: text "),
            (("call", "probe.0.fly"), "has no function `fly`; it has: echo, refuse, fail"),
            (("echo", "probe.0.heat"), "no data `heat`; it has: word"),
            (("status", "motor.0"), "no class `motor` is known here; there are: probe, tool"),
            (("list",), "list needs the id of the class `tcp`"),
        ]:
            code, out, err = self.say(*words)
            self.assertTrue(code == 2 and out == "" and why in err, (words, err))


if __name__ == "__main__":
    unittest.main()
