"""Pictures as PNG files, read back by a reader of this test."""

from __future__ import annotations

import pathlib
import struct
import tempfile
import unittest
import zlib

import rohrpost as rp

F = rp.ImageFormat


def read_png(data: bytes) -> tuple[int, int, int, int, list[bytes]]:
    """Width, height, colour, depth and rows; each chunk's check is looked at."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed, head = 8, b"", (0, 0, 0, 0)
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        content = data[at + 8 : at + 8 + length]
        (check,) = struct.unpack(">I", data[at + 8 + length : at + 12 + length])
        assert check == zlib.crc32(kind + content)
        if kind == b"IHDR":
            width, height, depth, colour, *rest = struct.unpack(">IIBBBBB", content)
            assert rest == [0, 0, 0]
            head = width, height, colour, depth
        elif kind == b"IDAT":
            packed += content
        at += 12 + length
    assert kind == b"IEND"
    pixels = zlib.decompress(packed)
    step = len(pixels) // head[1]
    rows = [pixels[step * row : step * (row + 1)] for row in range(head[1])]
    assert all(row[0] == 0 for row in rows)
    return (*head, [row[1:] for row in rows])


class Pictures(unittest.TestCase):
    def test_each_format_of_pixels_becomes_a_file_without_the_gaps(self) -> None:
        nan = float("nan")
        depths = struct.pack("<6f", 1.5, nan, 0.0, 65.534, 1e9, float("inf"))
        for format, row_bytes, pixels, expected in [
            (F.Gray8, 4, b"\x00\x80\xff?\x01\x02\x03?", (3, 2, 0, 8, [b"\x00\x80\xff", b"\x01\x02\x03"])),
            (F.Gray16, 6, b"\x01\x02\x03\x04\x05\x06" * 2, (3, 2, 0, 16, [b"\x02\x01\x04\x03\x06\x05"] * 2)),
            (F.Depth16, 7, b"\x01\x02\x03\x04\x05\x06?" * 2, (3, 2, 0, 16, [b"\x02\x01\x04\x03\x06\x05"] * 2)),
            (F.Rgb8, 9, bytes(range(18)), (3, 2, 2, 8, [bytes(range(9)), bytes(range(9, 18))])),
            (F.Bgr8, 9, bytes(range(18)), (3, 2, 2, 8, [
                bytes([2, 1, 0, 5, 4, 3, 8, 7, 6]), bytes([11, 10, 9, 14, 13, 12, 17, 16, 15]),
            ])),
            (F.Rgba8, 12, bytes(range(24)), (3, 2, 6, 8, [bytes(range(12)), bytes(range(12, 24))])),
            (F.DepthF32, 12, depths, (3, 2, 0, 16, [
                struct.pack(">3H", 1500, 0, 0), struct.pack(">3H", 65534, 65535, 65535),
            ])),
        ]:  # fmt: skip
            image = rp.Image(3, 2, row_bytes, format, pixels)
            self.assertEqual(read_png(image.to_png()), expected, format)

    def test_files_stay_as_they_are(self) -> None:
        made = rp.Image(1, 1, 1, F.Gray8, b"\x07").to_png()
        self.assertEqual(rp.Image(1, 1, 0, F.Png, made).to_png(), made)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "it.png"
            rp.Image(1, 1, 0, F.Png, made).save_png(path)
            self.assertEqual(path.read_bytes(), made)

    def test_what_cannot_be_one_is_told(self) -> None:
        for image, why in [
            (rp.Image(0, 2, 0, F.Gray8, b""), "an image of 0 by 2 pixels; both must be at least 1"),
            (rp.Image(3, 2, 2, F.Gray8, bytes(4)), "a row of 2 bytes; 3 pixels of Gray8 need at least 3"),
            (rp.Image(3, 2, 3, F.Gray8, bytes(5)), "5 bytes of pixels; 2 rows of 3 bytes are 6"),
            (rp.Image(1, 2, 0xFFFFFFFF, F.Gray8, b""), "0 bytes of pixels; 2 rows of 4294967295 bytes are 8589934590"),
            (rp.Image(1, 1, 1, F.Png, b"x"), "a Png file with rows of 1 bytes; `row_bytes` must be 0"),
            (rp.Image(1, 1, 0, F.Jpeg, b""), "a Jpeg file of 0 bytes"),
            (rp.Image(1, 1, 0, F.Png, b"GIF89a"), "the picture should be a PNG file, and does not begin as one"),
            (rp.Image(1, 1, 0, F.Jpeg, b"\xff"), "the picture is a Jpeg file already; write its `pixels` as they are"),
        ]:
            with self.assertRaises(rp.BadPicture) as wrong:
                image.to_png()
            self.assertEqual(str(wrong.exception), why)
        with self.assertRaisesRegex(rp.BadPicture, "decode it first"):
            rp.Image(1, 1, 0, F.Jpeg, b"\xff\xd8").rows()


if __name__ == "__main__":
    unittest.main()
