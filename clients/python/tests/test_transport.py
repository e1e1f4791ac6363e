"""Certificates and keys of a client."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path

import rohrpost as rp
from rohrpost import remote


class Files(unittest.TestCase):
    def test_a_key_that_others_may_read_is_refused_in_the_words_of_rust(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            names = "ca.pem", "laptop.system-1.pem", "laptop.system-1.key"
            for name in names:
                (Path(folder) / name).write_text("no certificate")
            key = Path(folder) / names[2]
            for mode in 0o666, 0o640, 0o604:
                key.chmod(mode)
                words = (
                    f"{key}: others than its owner may read these keys (mode {mode:o}); run `chmod 600 {key}`, and if "
                    "others could log in here, change the keys"
                )
                with self.assertRaises(rp.NoConnection) as raised:
                    remote.Tls(folder, "laptop.system-1").context()
                self.assertEqual(str(raised.exception), words)
            key.chmod(0o600)
            with self.assertRaisesRegex(rp.NoConnection, "cannot be read"):
                remote.Tls(folder, "laptop.system-1").context()


if __name__ == "__main__":
    unittest.main()
