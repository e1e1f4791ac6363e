"""What lies between a session and a socket: nothing, or TLS 1.3. Without a socket itself."""

from __future__ import annotations

import os
import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Union

from ..errors import NoConnection

SERVER = "tcp-router.rohrpost"
"""Name in the certificate of every TCP router."""


@dataclass(frozen=True)
class Tls:
    """The folder of certificates that ``rohrpost keys new`` made, and which of them is this program's own:
    ``ca.pem``, and of ``laptop.system-1`` the files ``laptop.system-1.pem`` and ``laptop.system-1.key``."""

    folder: str | Path
    own: str

    def context(self) -> ssl.SSLContext:
        """Raises :class:`NoConnection`, if a file is missing, is none of these, or others may read the key."""
        folder = Path(self.folder)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        files = folder / "ca.pem", folder / f"{self.own}.pem", folder / f"{self.own}.key"
        for file in files:
            if not file.is_file():
                raise NoConnection(f"there is no {file}; `rohrpost keys new` makes it, bring it here")
        _check_secret(files[2])
        try:
            context.load_verify_locations(files[0])
            context.load_cert_chain(files[1], files[2])
        except (ssl.SSLError, OSError) as error:
            raise NoConnection(f"the certificates in {folder} cannot be read: {error}") from None
        return context


def _check_secret(path: Path) -> None:
    """Refuses a key that others than its owner may read: the rule and the words of the programs in Rust
    (``open_secret``)."""
    mode = path.stat().st_mode & 0o7777
    # Windows has no such modes.
    if mode & 0o077 and os.name == "posix":
        raise NoConnection(
            f"{path}: others than its owner may read these keys (mode {mode:o}); run `chmod 600 {path}`, and if "
            "others could log in here, change the keys"
        )


class Plain:
    """Nothing in between."""

    def __init__(self) -> None:
        self._out = bytearray()

    @property
    def is_ready(self) -> bool:
        """Whether bytes of the session may be written."""
        return True

    def write(self, data: bytes) -> None:
        """Bytes of the session are to leave."""
        self._out += data

    def pending(self) -> bytearray:
        """Bytes for the socket; what it took is deleted from them."""
        return self._out

    def read(self, data: bytes) -> bytes:
        """The session's bytes in those that came from the socket."""
        return data


class Sealed:
    """TLS."""

    def __init__(self, context: ssl.SSLContext) -> None:
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._incoming, self._outgoing, server_hostname=SERVER)
        self._out = bytearray()
        self._is_ready = False
        self._shake()

    @property
    def is_ready(self) -> bool:
        """Whether bytes of the session may be written."""
        return self._is_ready

    def _shake(self) -> None:
        try:
            self._tls.do_handshake()
            self._is_ready = True
        except ssl.SSLWantReadError:
            pass
        finally:
            self._out += self._outgoing.read()

    def write(self, data: bytes) -> None:
        """Bytes of the session are to leave."""
        self._tls.write(data)
        self._out += self._outgoing.read()

    def pending(self) -> bytearray:
        """Bytes for the socket; what it took is deleted from them."""
        return self._out

    def read(self, data: bytes) -> bytes:
        """The session's bytes in those that came from the socket. Raises :class:`NoConnection`."""
        self._incoming.write(data)
        plain = bytearray()
        try:
            if not self._is_ready:
                self._shake()
            while self._is_ready:
                part = self._tls.read(65_536)
                if not part:
                    break
                plain += part
        except ssl.SSLWantReadError:
            pass
        except ssl.SSLZeroReturnError:
            pass
        except ssl.SSLError as error:
            raise NoConnection(_words(error)) from None
        finally:
            self._out += self._outgoing.read()
        return bytes(plain)


def _words(error: ssl.SSLError) -> str:
    reason = (error.reason or str(error)).lower().replace("_", " ")
    if isinstance(error, ssl.SSLCertVerificationError):
        return (
            f"the certificate of the TCP router is not believed: {error.verify_message}; is `ca.pem` its authority's?"
        )
    if "alert" in reason:
        return f"the TCP router refuses this end's certificate: {reason}; use that of this node (`rohrpost keys new`)"
    if "wrong version number" in reason or "record layer" in reason:
        return "the TCP router does not speak TLS; write the same `security` in [tcp] at both ends"
    return f"TLS: {reason}"


Transport = Union[Plain, Sealed]
