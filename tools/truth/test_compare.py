#!/usr/bin/env python3
"""Tests `compare.py` on a bake that is known everywhere: two rectangles in one atlas, written here, whose light is linear in
world position, so that bilinear lookups must return it exactly. Needs numpy alone."""

import json
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import exr

SIZE = 32
HERE = Path(__file__).parent


def light(position):
    """The irradiance that everything is made of, RGB."""
    return position @ np.array([[1.0, 0.2, 0.0], [0.0, 2.0, 0.5], [0.3, 0.0, 1.0]]) + 5.0


def write_out(folder, corners, texels, factor):
    """scene.glb and lightmap_0.exr: rectangle k, a node moved by its first corner, has the texel square `texels[k]`."""
    blob, views, accessors, meshes, nodes = b"", [], [], [], []

    def add(array, kind, component):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind})
        blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(accessors) - 1

    image = np.full((SIZE, SIZE, 3), 1e6)
    for c, (x, y, side) in zip(corners, texels):
        # Texel centres reach half a texel beyond the rectangle, so that every lookup stays linear.
        uv = (np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side + [x, y]) / SIZE
        attributes = {"POSITION": add((c - c[0]).astype("<f4"), "VEC3", 5126), "TEXCOORD_1": add(uv.astype("<f4"), "VEC2", 5126)}
        # The second triangle starts at another vertex than the truth's: lookups have to go by position.
        indices = add(np.array([0, 1, 2, 3, 0, 2], "u1"), "SCALAR", 5121)
        meshes.append({"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]})
        nodes.append({"mesh": len(meshes) - 1, "translation": c[0].tolist()})
        j, i = np.mgrid[y - 1 : y + side + 1, x - 1 : x + side + 1]
        s, t = ((i + 0.5 - x) / side)[..., None], ((j + 0.5 - y) / side)[..., None]
        image[j, i] = light(c[0] + s * (c[1] - c[0]) + t * (c[3] - c[0])) * factor
    doc = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [{"extensions": {"MOZ_lightmap": {"index": 0, "texCoord": 1}}}],
        "textures": [{"extensions": {"EXT_texture_exr": {"source": 0}}}],
        "images": [{"uri": "lightmap_0.exr"}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(doc).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    (folder / "scene.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    exr.write(folder / "lightmap_0.exr", image)


def truth(corners):
    """500 points with the light that there is; on the second rectangle all light has bounced."""
    rng = np.random.default_rng(3)
    points = []
    for _ in range(500):
        k, t = int(rng.integers(2)), int(rng.integers(2))
        s, v = np.sqrt(rng.random()), rng.random()
        b = np.array([1 - s, v * s])
        v0, v1, v2 = corners[k][[0, 1, 2] if t == 0 else [0, 2, 3]]
        p = v0 + b[0] * (v1 - v0) + b[1] * (v2 - v0)
        e = light(p)
        points.append([k, 0, t, b.tolist(), p.tolist(), [0, 1, 0], e.tolist(), (e * (k == 0)).tolist(), 0.0])
    return {
        "how": {"standard_error_percent": {"median": 0.0, "p95": 0.0}},
        "objects": [{"node": k, "name": f"r{k}"} for k in range(2)],
        "columns": ["node", "primitive", "triangle", "barycentrics", "position", "normal", "total", "direct", "error"],
        "points": points,
    }


def main():
    corners = [
        np.array([[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2]], float),
        np.array([[-1, 1, 0], [-1, 3, 0.5], [-3, 3, 0.5], [-3, 1, 0]], float),
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "truth.json").write_text(json.dumps(truth(corners)))

        def compare(factor, *flags):
            write_out(folder, corners, [(2, 3, 10), (18, 16, 12)], factor)
            command = [sys.executable, HERE / "compare.py", folder / "truth.json", folder, "--json", *flags]
            run = subprocess.run(command, capture_output=True, text=True)
            assert run.stdout, run.stderr
            return run.returncode, json.loads(run.stdout)

        code, right = compare(1.0, "--max-median", "0.01", "--max-p95", "0.01", "--max-bias", "0.01")
        assert code == 0 and right["all"]["max"] < 1e-3 and right["all"]["points"] == 500, right
        assert 200 < right["bounced"]["points"] < 300, right
        code, bright = compare(1.03, "--max-bias", "2")
        assert code == 1 and abs(bright["all"]["bias"] - 3) < 1e-3 and abs(bright["bounced"]["median"] - 3) < 1e-3, bright
    print("compare.py finds every point, and sees what is wrong")


if __name__ == "__main__":
    main()
