"""A robot of a team for a test that has its clock and its radio: a question a line from the input, an answer a line.

| question | answer |
| --- | --- |
| `again BYTES` | the message written anew, or `malformed` and why |
| `robot OWN INCARNATION MAP BEAT-NS MAX-AGE-NS` | nothing; a robot that starts |
| `hear NOW-NS BYTES` | nothing |
| `see NOW-NS X-MM Y-MM` | nothing; the robot has seen an intruder |
| `beat NOW-NS` | the messages to send |
| `tell NOW-NS` | leader, group, 1 if its view is that of all, synchros, digests |

Bytes are hexadecimal.
"""

import sys

from team import Malformed, Robot, decode, encode


def again(data):
    try:
        return encode(decode(data)).hex()
    except Malformed as why:
        return f"malformed {why}"


def answers(lines):
    robot = None
    for line in lines:
        do, *words = line.split(" ")
        if do == "again":
            yield again(bytes.fromhex(words[0]))
            continue
        if do == "hear":
            robot.hear(int(words[0]), decode(bytes.fromhex(words[1])))
            yield ""
            continue
        numbers = [int(word) for word in words]
        if do == "robot":
            robot = Robot(*numbers)
            yield ""
        elif do == "see":
            robot.see(numbers[0], tuple(numbers[1:]))
            yield ""
        elif do == "beat":
            yield " ".join(encode(message).hex() for message in robot.beat(*numbers))
        elif do == "tell":
            leader, group = robot.pair(*numbers)
            out = leader, group, int(robot.agrees(*numbers)), robot.synchros, *robot.digests()
            yield " ".join(map(str, out))
        else:
            raise SystemExit(f"`{do}` is no question")


if __name__ == "__main__":
    for answer in answers(line.rstrip("\n") for line in sys.stdin):
        print(answer, flush=True)
