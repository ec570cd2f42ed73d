#!/usr/bin/env python3
"""Path-traces irradiance at random surface points of a glTF scene: `make_truth.py SCENE -o TRUTH.json[.gz]`.

Points are uniform by surface area over all triangles, front side, where alpha leaves a surface. Written are, per point: the node,
primitive, triangle and barycentrics (of the triangle's second and third vertex), world position (m), receiving normal,
irradiance in lux as linear RGB, total and direct, and the standard error of the total's channel mean.
"""

import argparse
import gzip
import json
import time
from pathlib import Path

import numpy as np

import gltf
from tracer import Tracer, dr, mi

# Points are traced in groups of about this many lanes.
LANES = 1 << 20


def draw(scene, tracer, count, seed):
    """Random points: triangle indices and barycentrics."""
    rng = np.random.default_rng(seed)
    cumulative = np.cumsum(scene.area)
    triangle, b = np.zeros(0, np.int64), np.zeros((0, 2))
    while len(triangle) < count:
        n = count - len(triangle)
        t = np.minimum(np.searchsorted(cumulative, rng.random(n) * cumulative[-1], "right"), len(cumulative) - 1)
        s, v = np.sqrt(rng.random(n)), rng.random(n)
        c = np.stack([1 - s, v * s], 1)
        solid = tracer.solid(mi.UInt32(t.astype(np.uint32)), mi.Point2f(*c.T.astype(np.float32)), mi.Bool(True))
        keep = np.broadcast_to(solid.numpy(), (n,))
        triangle, b = np.concatenate([triangle, t[keep]]), np.concatenate([b, c[keep]])
    return triangle, b


def surface(scene, triangle, b):
    """Positions, receiving normals and face normals of points."""
    w = np.stack([1 - b.sum(1), b[:, 0], b[:, 1]], 1)
    position = np.einsum("nk,nkx->nx", w, scene.position[triangle])
    face = scene.face[triangle]
    normal = gltf.unit(np.einsum("nk,nkx->nx", w, scene.normal[triangle]))
    turned = np.einsum("nx,nx->n", normal, face) <= 0
    return position, np.where(turned[:, None], face, normal), face


class Sums:
    """Running sums of rounds, point by point."""

    def __init__(self, count):
        self.rgb = np.zeros((2, count, 3))  # direct, total
        self.moments = np.zeros((2, count))  # of the total's channel mean
        self.rounds = np.zeros(count, np.int64)

    def add(self, index, direct, total):
        """One round of each of these points; a point may come more than once."""
        mean = total.mean(1)
        for to, what in zip((*self.rgb, *self.moments, self.rounds), (direct, total, mean, mean**2, 1)):
            np.add.at(to, index, what)

    def state(self):
        """Which points count, their relative standard errors, and all standard errors."""
        mean, square = self.moments / self.rounds
        variance = np.maximum(square - mean**2, 0) / np.maximum(self.rounds - 1, 1)
        lit = mean > 0.02 * mean.mean()
        error = np.sqrt(variance)
        return lit, np.divide(error, mean, out=np.zeros(len(mean)), where=lit), error


def digits(x, n=5):
    """A number as JSON with n significant digits."""
    return float(f"{x:.{n}g}")


def write(path, scene, name, triangle, b, position, normal, sums, error, how):
    """Writes a truth file, whole or not at all."""
    direct, total = sums.rgb / sums.rounds[:, None]
    nodes = sorted(set(scene.node[triangle].tolist()))
    out = {
        "scene": name,
        "how": how | {"triangles": len(scene.area), "area_m2": digits(scene.area.sum(), 8)},
        "objects": [{"node": i, "name": scene.names[i]} for i in nodes],
        "columns": ["node", "primitive", "triangle", "barycentrics", "position", "normal", "total", "direct", "error"],
        "points": [
            [int(scene.node[t]), int(scene.primitive[t]), int(scene.triangle[t])]
            + [[digits(x, 7) for x in b[i]], [digits(x, 7) for x in position[i]], [digits(x) for x in normal[i]]]
            + [[digits(x) for x in total[i]], [digits(x) for x in direct[i]], digits(error[i], 2)]
            for i, t in enumerate(triangle)
        ],
    }
    objects = ",\n".join("  " + json.dumps(o) for o in out.pop("objects"))
    rows = ",\n".join(json.dumps(p, separators=(",", ":")) for p in out.pop("points"))
    text = json.dumps(out, indent=1)[:-2] + ',\n "objects": [\n' + objects + '\n ],\n "points": [\n' + rows + "\n]}\n"
    data = text.encode()
    part = path.with_name(path.name + ".part")
    part.write_bytes(gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)
    part.replace(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--points", type=int, default=2000)
    parser.add_argument("--samples", type=int, help="mean paths per point; default: until --error or --minutes")
    parser.add_argument("--error", type=float, default=0.4, help="stop at this median relative standard error, percent")
    parser.add_argument("--minutes", type=float, default=10.0, help="or after this time")
    parser.add_argument("--side", type=int, default=8, help="strata along each side of a round's sample square")
    parser.add_argument("--pilot", type=int, default=48, help="rounds that say where paths are needed")
    parser.add_argument("--threads", type=int, help="of the tracer; default: all")
    parser.add_argument("--seed", type=int, default=1)
    a = parser.parse_args()
    if a.threads:
        dr.set_thread_count(a.threads)

    scene = gltf.load(a.scene)
    tracer = Tracer(scene)
    triangle, b = draw(scene, tracer, a.points, a.seed)
    position, normal, face = surface(scene, triangle, b)
    exact = tracer.punctual_direct(position, normal, face)

    n, per = a.points, a.side**2
    group = max(1, LANES // per)
    begin, seed = time.time(), 1000 * a.seed

    def trace(sums, index):
        """One more round for each of these points."""
        nonlocal seed
        for start in range(0, len(index), group):
            i = index[start : start + group]
            seed += 1
            direct, bounced = tracer.round(position[i], normal[i], face[i], a.side, seed)
            direct += exact[i]
            sums.add(i, direct, direct + bounced)

    # A pilot says where paths are needed, and is then thrown away: points that got fewer paths because their pilot
    # happened to miss a bright spot would otherwise be too dark.
    pilot = Sums(n)
    trace(pilot, np.tile(np.arange(n), a.pilot))
    lit, relative, _ = pilot.state()
    share = np.clip(relative**2 / max(np.percentile(relative[lit] ** 2, 90), 1e-12), 1 / 8, 1) if lit.any() else np.ones(n)
    print(f"pilot of {a.pilot * per} paths a point, {time.time() - begin:.0f} s: {lit.sum()} points lit, median error {100 * np.median(relative[lit]):.2f} %", flush=True)

    sums, owed, told = Sums(n), np.zeros(n), 0.0
    while True:
        owed += share * 16
        due = np.floor(owed).astype(int)
        owed -= due
        trace(sums, np.repeat(np.arange(n), due))
        lit, relative, error = sums.state()
        median = 100 * np.median(relative[lit]) if lit.any() else 0.0
        tail = 100 * np.percentile(relative[lit], 95) if lit.any() else 0.0
        paths = int(sums.rounds.mean() * per)
        if a.samples is not None:
            done = paths >= a.samples
        else:
            done = sums.rounds.min() >= 16 and (median <= a.error or time.time() - begin > 60 * a.minutes)
        if done or time.time() - told > 60:
            told = time.time()
            print(f"{paths} paths a point, {told - begin:.0f} s: standard error median {median:.2f} %, 95th percentile {tail:.2f} %", flush=True)
            how = {
                "tool": "tools/truth/make_truth.py",
                "mitsuba": mi.__version__,
                "seed": a.seed,
                "paths_per_point": paths,
                "standard_error_percent": {"median": digits(median, 3), "p95": digits(tail, 3)},
            }
            write(a.output, scene, a.scene.name, triangle, b, position, normal, sums, error, how)
        if done:
            break

    direct, total = (x.mean(1) for x in sums.rgb / sums.rounds[:, None])
    bounced = 100 * np.median((total - direct)[lit] / total[lit]) if lit.any() else 0.0
    print(f"{a.output}: mean {total.mean():.5g} lx, {lit.sum()} of {n} points above 2 % of it, bounced share {bounced:.0f} % (median)")


if __name__ == "__main__":
    main()
