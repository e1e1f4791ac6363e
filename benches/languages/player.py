"""A module that plays ping-pong with another one by data; see ``benches/src/player.rs``. Argument: a configuration."""

import os
import signal

import rohrpost as rp

from ping_pong import HANDSHAKE, Ping, Pong, Turn, ends_when_it_fails, message_of

turn = Turn()
own, other = ("player.0", "player.1") if turn.is_ping else ("player.1", "player.0")
handshake = message_of(HANDSHAKE, turn.bytes)


class Player(rp.Module, klass="player"):
    """Plays."""

    def __init__(self) -> None:
        self.side, self.has_begun = Ping(turn) if turn.is_ping else Pong(), False

    @rp.data_out(1)
    def ball(self) -> bytes:
        """What is thrown."""
        return b""

    @rp.every(0.02)
    @ends_when_it_fails
    def serve(self) -> None:
        # Subscriptions take a moment.
        if turn.is_ping and not self.has_begun:
            self.publish("ball", handshake)

    @rp.on_data(other, "ball")
    @ends_when_it_fails
    def came(self, ball: bytes) -> None:
        if ball == handshake:
            if not turn.is_ping:
                self.publish("ball", ball)
            elif not self.has_begun:
                self.has_begun = True
                self.publish("ball", self.side.first())
            return
        back = self.side.came(ball)
        if turn.is_ping or not self.side.is_done:
            self.publish("ball", back)
        if self.side.is_done:
            self.side.save()
            os.kill(os.getpid(), signal.SIGTERM)


rp.run(Player, ["--config", turn.own[0], "--name", own])
