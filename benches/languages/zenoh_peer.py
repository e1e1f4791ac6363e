"""zenoh from PyPI, as a peer of one computer: publish and subscribe between two programs. Argument: an address."""

import json
import time

import zenoh

from ping_pong import Turn, play

turn = Turn()
locator = json.dumps([f"tcp/{turn.own[0]}"])
config = zenoh.Config()
config.insert_json5("mode", '"peer"')
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("scouting/gossip/enabled", "false")
# It would leave files in shared memory; messages of 64 bytes go by TCP with it, too.
config.insert_json5("transport/shared_memory/enabled", "false")
if turn.is_ping:
    turn.meet()
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("connect/endpoints", locator)
    session = zenoh.open(config)
else:
    config.insert_json5("listen/endpoints", locator)
    session = zenoh.open(config)
    turn.meet()
out, back = ("there", "back") if turn.is_ping else ("back", "there")
subscriber = session.declare_subscriber(back)
publisher = session.declare_publisher(out, congestion_control=zenoh.CongestionControl.BLOCK, express=True)
# Until each knows what the other has declared, messages go nowhere.
while not publisher.matching_status.matching:
    time.sleep(0.001)
turn.meet()
play(turn, publisher.put, lambda: subscriber.recv().payload.to_bytes())
subscriber.undeclare()
session.close()
