"""Reads and writes OpenEXR images with numpy alone: single part, scan lines or one level of tiles; no, RLE, ZIPS or ZIP compression."""

import struct
import zlib

import numpy as np

KIND = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}


def text(data, at):
    """A null-terminated string and what follows it."""
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def unpack(data, method, size):
    """A chunk's bytes, decompressed."""
    if method == 0 or len(data) == size:
        return data
    if method == 1:
        out, at = bytearray(), 0
        while at < len(data):
            n = data[at] - 256 if data[at] > 127 else data[at]
            if n < 0:
                out += data[at + 1 : at + 1 - n]
                at += 1 - n
            else:
                out += data[at + 1 : at + 2] * (n + 1)
                at += 2
        packed = np.frombuffer(bytes(out), np.uint8)
    elif method in (2, 3):
        packed = np.frombuffer(zlib.decompress(data), np.uint8)
    else:
        raise ValueError(f"EXR compression {method} is not read here: write NONE, RLE, ZIPS or ZIP")
    # Undo the byte predictor, then put the two halves back together.
    n = np.arange(len(packed), dtype=np.int64)
    plain = ((np.cumsum(packed, dtype=np.int64) - 128 * n) & 255).astype(np.uint8)
    half = (len(plain) + 1) // 2
    out = np.empty_like(plain)
    out[0::2], out[1::2] = plain[:half], plain[half:]
    return out.tobytes()


def read(path):
    """`({channel: [height, width] float64}, {attribute: raw bytes})` of an image file."""
    data = open(path, "rb").read()
    magic, version = struct.unpack_from("<iI", data)
    if magic != 20000630 or version & 0x1800:
        raise ValueError(f"{path}: not a single-part OpenEXR image")
    at, header = 8, {}
    while data[at]:
        name, at = text(data, at)
        _, at = text(data, at)
        size = struct.unpack_from("<i", data, at)[0]
        header[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    at += 1
    channels, c = [], 0
    while header["channels"][c]:
        name, c = text(header["channels"], c)
        channels.append((name, KIND[struct.unpack_from("<i", header["channels"], c)[0]]))
        c += 16
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"])
    width, height, method = x1 - x0 + 1, y1 - y0 + 1, header["compression"][0]
    out = {name: np.zeros((height, width)) for name, _ in channels}
    tile = struct.unpack_from("<II", header["tiles"]) if version & 0x200 else None
    if tile:
        chunks = -(-width // tile[0]) * -(-height // tile[1])
    else:
        lines = {0: 1, 1: 1, 2: 1, 3: 16}.get(method, 32)
        chunks = -(-height // lines)
    for offset in struct.unpack_from(f"<{chunks}Q", data, at):
        if tile:
            tx, ty, *_, size = struct.unpack_from("<5i", data, offset)
            x, y, offset = tx * tile[0], ty * tile[1], offset + 20
            w, h = min(tile[0], width - x), min(tile[1], height - y)
        else:
            y, size = struct.unpack_from("<2i", data, offset)
            x, y, offset = 0, y - y0, offset + 8
            w, h = width, min(lines, height - y)
        row = w * sum(kind.itemsize for _, kind in channels)
        rows = np.frombuffer(unpack(data[offset : offset + size], method, row * h), np.uint8).reshape(h, row)
        c = 0
        for name, kind in channels:
            out[name][y : y + h, x : x + w] = np.ascontiguousarray(rows[:, c : c + w * kind.itemsize]).view(kind)
            c += w * kind.itemsize
    return out, header


def rgb(path):
    """An image as `[height, width, 3]`."""
    channels, _ = read(path)
    return np.stack([channels[c] for c in "RGB"], 2)


def write(path, image):
    """Uncompressed 32-bit scan lines."""
    h, w, _ = image.shape
    channels = b"".join(c + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, w - 1, h - 1)
    head = struct.pack("<ii", 20000630, 2)
    for name, kind, value in (
        (b"channels", b"chlist", channels),
        (b"compression", b"compression", b"\0"),
        (b"dataWindow", b"box2i", window),
        (b"displayWindow", b"box2i", window),
        (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
        (b"screenWindowCenter", b"v2f", struct.pack("<ff", 0, 0)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1)),
    ):
        head += name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value
    head += b"\0"
    rows = [struct.pack("<ii", y, 12 * w) + image[y, :, ::-1].T.astype("<f4").tobytes() for y in range(h)]
    at = len(head) + 8 * h
    path.write_bytes(head + b"".join(struct.pack("<Q", at + y * len(rows[0])) for y in range(h)) + b"".join(rows))
