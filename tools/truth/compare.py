#!/usr/bin/env python3
"""Holds a bake against path-traced truth: `compare.py TRUTH.json[.gz] OUT`, where OUT is what `rebake bake -o OUT` wrote.

Every truth point is looked up bilinearly in OUT's lightmaps, through OUT's scene.glb (TEXCOORD_1, MOZ_lightmap). Errors are of the
mean over RGB, relative to the truth, over the points whose truth exceeds 2 % of the mean over all points; the darker
points are held against that mean. Ends with 1 if a limit that was given is exceeded.
"""

import argparse
import gzip
import json
import struct
import sys
import zlib
from pathlib import Path

import numpy as np

import exr
import gltf


class Bake:
    """A written bake: where a surface point's light is kept."""

    def __init__(self, folder):
        self.file = gltf.File(Path(folder) / "scene.glb")
        self.world = dict(self.file.world())
        self.pages, self.primitives = {}, {}

    def page(self, texture):
        """The irradiance that a texture holds."""
        if texture not in self.pages:
            t = self.file.json["textures"][texture]
            source = t.get("extensions", {}).get("EXT_texture_exr", t)["source"]
            self.pages[texture] = exr.rgb(self.file.path.parent / self.file.json["images"][source]["uri"])
        return self.pages[texture]

    def primitive(self, node, k):
        """World positions and lightmap coordinates of a primitive's triangles, its page and factor."""
        if (node, k) not in self.primitives:
            p = self.file.json["meshes"][self.file.json["nodes"][node]["mesh"]]["primitives"][k]
            lightmap = self.file.json["materials"][p["material"]]["extensions"]["MOZ_lightmap"]
            index, m = self.file.triangles(p), self.world[node]
            position = self.file.accessor(p["attributes"]["POSITION"]) @ m[:3, :3].T + m[:3, 3]
            uv = self.file.accessor(p["attributes"][f"TEXCOORD_{lightmap.get('texCoord', 1)}"]).astype(float)
            self.primitives[node, k] = position[index], uv[index], lightmap["index"], lightmap.get("intensity", 1.0)
        return self.primitives[node, k]

    def irradiance(self, node, k, triangle, b, at):
        """RGB at a point of a triangle; its barycentrics are found again should the triangle start at another vertex."""
        position, uv, texture, factor = self.primitive(node, k)
        v = position[triangle]
        near = 1e-4 * (1 + np.abs(v).max())
        w = np.array([1 - b[0] - b[1], b[0], b[1]])
        if np.linalg.norm(w @ v - at) > near:
            solved = np.linalg.lstsq((v[1:] - v[0]).T, at - v[0], rcond=None)[0]
            w = np.array([1 - solved.sum(), *solved])
            if np.linalg.norm(w @ v - at) > near or w.min() < -1e-2:
                raise SystemExit(f"node {node}, primitive {k}, triangle {triangle} lies elsewhere: is this the truth's scene?")
        return bilinear(self.page(texture), w @ uv[triangle]) * factor


def bilinear(image, uv):
    """A texture lookup, clamped to the edge."""
    h, w = image.shape[:2]
    x, y = np.clip(uv[0] * w - 0.5, 0, w - 1), np.clip(uv[1] * h - 0.5, 0, h - 1)
    x0, y0 = min(int(x), max(w - 2, 0)), min(int(y), max(h - 2, 0))
    fx, fy = x - x0, y - y0
    x1, y1 = min(x0 + 1, w - 1), min(y0 + 1, h - 1)
    top = image[y0, x0] * (1 - fx) + image[y0, x1] * fx
    return top * (1 - fy) + (image[y1, x0] * (1 - fx) + image[y1, x1] * fx) * fy


def statistics(truth, bake):
    """Errors of some points, percent."""
    if len(truth) == 0:
        return {"points": 0, "bias": 0.0, "mean_signed": 0.0, "median": 0.0, "p95": 0.0, "max": 0.0}
    signed = 100 * (bake - truth) / truth
    e = np.abs(signed)
    return {
        "points": len(truth),
        "bias": 100 * (bake.sum() - truth.sum()) / truth.sum(),
        "mean_signed": signed.mean(),
        "median": np.median(e),
        "p95": np.percentile(e, 95),
        "max": e.max(),
    }


def scatter(path, truth, bake, bounced):
    """A PNG of bake over truth, both logarithmic from 0.1 % to 100 % of the largest truth; points lit by bounces orange."""
    size = 512
    image = np.full((size, size, 3), 255, np.uint8)
    line = np.arange(size)
    image[size - 1 - line, line] = 200

    def place(x):
        return np.clip((np.log10(np.maximum(x, 1e-30) / truth.max()) + 3) / 3 * (size - 1), 0, size - 1).astype(int)

    for group, color in ((~bounced, (30, 90, 200)), (bounced, (220, 110, 20))):
        x, y = place(truth[group]), size - 1 - place(bake[group])
        for dx in (0, 1):
            for dy in (0, 1):
                image[np.minimum(y + dy, size - 1), np.minimum(x + dx, size - 1)] = color
    raw = b"".join(b"\0" + row.tobytes() for row in image)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0))
    Path(path).write_bytes(b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def place(point, names):
    """Where a truth point lies, in words."""
    at, n = (", ".join(f"{x:.3f}" for x in point[k]) for k in ("position", "normal"))
    where = f"node {point['node']}.{point['primitive']}, triangle {point['triangle']}"
    return f"at ({at}) normal ({n}) {names[point['node']]} ({where})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("truth", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.add_argument("--worst", type=int, default=10, help="how many of the worst points to list")
    parser.add_argument("--objects", type=int, default=0, help="how many objects to list, by their share of the summed error")
    parser.add_argument("--png", type=Path, help="write bake over truth as a picture")
    limits = {
        "median": ("all", "median"),
        "p95": ("all", "p95"),
        "bias": ("all", "bias"),
        "bounced-median": ("bounced", "median"),
        "bounced-bias": ("bounced", "bias"),
        "dark": ("dark", "mean"),
    }
    for name in limits:
        parser.add_argument(f"--max-{name}", type=float, metavar="PERCENT")
    a = parser.parse_args()

    data = a.truth.read_bytes()
    doc = json.loads(gzip.decompress(data) if a.truth.suffix == ".gz" else data)
    names = {o["node"]: o["name"] for o in doc["objects"]}
    points = [dict(zip(doc["columns"], p)) for p in doc["points"]]
    out = Bake(a.out)
    got = np.array(
        [
            out.irradiance(p["node"], p["primitive"], p["triangle"], p["barycentrics"], np.array(p["position"]))
            for p in points
        ]
    ).mean(1)
    if not np.isfinite(got).all():
        raise SystemExit(f"{np.sum(~np.isfinite(got))} points look up a value that is not finite")
    truth = np.array([p["total"] for p in points]).mean(1)
    direct = np.array([p["direct"] for p in points]).mean(1)
    mean = truth.mean()
    lit = truth > 0.02 * mean
    bounced = truth - direct > direct
    result = {
        "all": statistics(truth[lit], got[lit]),
        "direct": statistics(truth[lit & ~bounced], got[lit & ~bounced]),
        "bounced": statistics(truth[lit & bounced], got[lit & bounced]),
        "dark": {
            "points": int((~lit).sum()),
            "mean": 100 * got[~lit].mean() / mean if (~lit).any() else 0.0,
            "truth": 100 * truth[~lit].mean() / mean if (~lit).any() else 0.0,
            "max": 100 * got[~lit].max() / mean if (~lit).any() else 0.0,
        },
        "truth_mean_lux": mean,
        "truth_standard_error": doc["how"]["standard_error_percent"],
    }
    result = json.loads(json.dumps(result), parse_float=lambda x: float(f"{float(x):.5g}"))
    broken = []
    for name, (group, key) in limits.items():
        limit = getattr(a, "max_" + name.replace("-", "_"))
        if limit is not None and abs(result[group][key]) > limit:
            broken.append(f"{group} {key} {result[group][key]:.2f} % exceeds {limit} %")
    result["exceeded"] = broken

    if a.png:
        scatter(a.png, truth[lit], got[lit], bounced[lit])
    if a.json:
        print(json.dumps(result, indent=1))
    else:
        print(f"truth: mean {mean:.5g} lx, standard error {result['truth_standard_error']['median']} % (median)")
        print("points            n     bias   signed   median      p95      max   (percent)")
        for group, name in (("all", "all lit"), ("direct", "mainly direct"), ("bounced", "mainly bounced")):
            s = result[group]
            row = " ".join(f"{s[k]:8.2f}" for k in ("bias", "mean_signed", "median", "p95", "max"))
            print(f"{name:14s} {s['points']:4d} {row}")
        d = result["dark"]
        print(f"dark           {d['points']:4d} mean {d['mean']:.3f} % of the scene's mean (truth {d['truth']:.3f} %), max {d['max']:.2f} %")
        error = np.where(lit, np.abs(got - truth) / np.where(lit, truth, 1), 0)
        if a.worst:
            print("worst points: error, bake, truth, direct (lx), where")
        for i in np.argsort(-error, kind="stable")[: a.worst]:
            p = points[i]
            print(
                f"{100 * (got[i] - truth[i]) / truth[i] if lit[i] else 0:+8.1f} % {got[i]:9.4g} {truth[i]:9.4g} {direct[i]:9.4g}  "
                f"{place(p, names)}"
            )
        if a.worst and not lit.all():
            print("brightest of the dark points: bake, truth (percent of the scene's mean), where")
        for i in np.flatnonzero(~lit)[np.argsort(-got[~lit], kind="stable")][: a.worst]:
            p = points[i]
            print(f"{100 * got[i] / mean:9.3f} {100 * truth[i] / mean:9.3f}  {place(p, names)}")
        node = np.array([p["node"] for p in points])
        total = {k: error[node == k].sum() for k in names}
        for k in sorted(total, key=lambda k: -total[k])[: a.objects]:
            s = statistics(truth[lit & (node == k)], got[lit & (node == k)])
            print(f"  {names[k]} (node {k}): {s['points']} points, bias {s['bias']:+.2f} %, median {s['median']:.2f} %, p95 {s['p95']:.2f} %")
        for line in broken:
            print(f"FAIL: {line}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
