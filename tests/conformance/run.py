"""Runs the conformance suite against a client in any language. Needs Python's standard library alone.

    python3 run.py [--words] [--only-live] [--live HOST:PORT DIGESTS] -- CLIENT ARGUMENTS…

The client is started, and answers one question a line; README.md beside this file has the protocol. ``--words``: its
errors are to say what Rust's say, too. ``--live``: also the cases that need a TCP router, at which the suite takes part
itself, as a program of system 7. ``--only-live``: no others.

Prints ``conforms: N cases`` at first, or what does not.
"""

import json
import math
import pathlib
import subprocess
import sys

CASES = pathlib.Path(__file__).parent / "cases"


class Client:
    """The client under test."""

    def __init__(self, command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def tell(self, question):
        self.process.stdin.write(json.dumps(question) + "\n")
        self.process.stdin.flush()

    def hear(self):
        """The next answer: a line that begins with `{`. All others are for people."""
        while True:
            line = self.process.stdout.readline()
            if not line:
                raise SystemExit(f"the client ended, with exit code {self.process.wait()}")
            if line.startswith("{"):
                return json.loads(line)

    def ask(self, question):
        self.tell(question)
        return self.hear()

    def end(self):
        self.process.stdin.close()
        self.process.wait(30)


def is_same(expected, got):
    """As JSON: a bool is no number, 1.0 is 1, and zeros have signs."""
    if isinstance(expected, bool) or isinstance(got, bool):
        return expected is got
    if isinstance(expected, (int, float)) and isinstance(got, (int, float)):
        return expected == got and math.copysign(1, expected) == math.copysign(1, got)
    if isinstance(expected, dict) and isinstance(got, dict):
        return expected.keys() == got.keys() and all(is_same(value, got[key]) for key, value in expected.items())
    if isinstance(expected, list) and isinstance(got, list):
        return len(expected) == len(got) and all(map(is_same, expected, got))
    return type(expected) is type(got) and expected == got


def without_words(answer):
    if isinstance(answer.get("ok"), dict):
        return {"ok": {key: value for key, value in answer["ok"].items() if key != "words"}}
    return {"error": ""} if "error" in answer else answer


def check_files(client, words):
    """How many cases there were, and what is wrong."""
    count, wrong = 0, []
    for file in sorted(CASES.glob("*.json")):
        for case in json.loads(file.read_text(encoding="utf-8")):
            count += 1
            expected, got = case["answer"], client.ask(case["ask"])
            if not words:
                expected, got = without_words(expected), without_words(got)
            if not is_same(expected, got):
                wrong.append(f"{file.name}: {json.dumps(case['ask'])}\n  expected {expected}\n  got      {got}")
    return count, wrong


def main():
    options, command = sys.argv[1:], []
    if "--" in options:
        at = options.index("--")
        options, command = options[:at], options[at + 1 :]
    if not command:
        raise SystemExit(__doc__)
    client = Client(command)
    count, wrong = (0, []) if "--only-live" in options else check_files(client, "--words" in options)
    if "--live" in options:
        import live

        server, digests = options[options.index("--live") + 1 :][:2]
        for name, problem in live.check(client, server, digests):
            count += 1
            if problem:
                wrong.append(f"live: {name}\n  {problem}")
    client.end()
    if wrong:
        print(f"{len(wrong)} of {count} cases do not conform\n" + "\n".join(wrong))
        raise SystemExit(1)
    print(f"conforms: {count} cases")


if __name__ == "__main__":
    main()
