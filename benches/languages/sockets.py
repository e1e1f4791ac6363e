"""What a round trip takes between two programs in Python at least: bare TCP sockets. Its argument is an address."""

import socket

from ping_pong import Turn, play

turn = Turn()
host, port = turn.own[0].rsplit(":", 1)
address = (host, int(port))
if turn.is_ping:
    turn.meet()
    stream = socket.create_connection(address)
else:
    with socket.create_server(address) as server:
        turn.meet()
        stream, _ = server.accept()
stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
turn.meet()


def receive():
    data = stream.recv(turn.bytes)
    while len(data) < turn.bytes:
        more = stream.recv(turn.bytes - len(data))
        if not more:
            raise EOFError("the other end has gone")
        data += more
    return data


with stream:
    play(turn, stream.sendall, receive)
