#!/usr/bin/env python3
"""Bakes a scene with rebake and with Blender's Cycles into the same atlas, on as many threads, and says how long each takes to a median
error against path-traced truth. `tools/cycles/run` sets up what this needs."""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "truth"))
import exr  # noqa: E402


def run(command, **environment):
    """The output of a command; ends with what it said if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}:\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


def error(truth, folder):
    """What compare.py finds over all lit points, percent."""
    compare = HERE.parent / "truth" / "compare.py"
    out = run([sys.executable, compare, truth, folder, "--json"])
    return json.loads(out)["all"]


def row(who, seconds, e):
    """A line of the table."""
    print(f"{who:28s} {seconds:9.2f} s {e['median']:8.2f} {e['p95']:8.2f} {e['bias']:+8.2f}", flush=True)


def seconds_to(points, target):
    """Seconds to a median error, from (seconds, error) in order of seconds: between two points by their logarithms, beyond the
    last by the square root of the samples; and how that was found."""
    for (t0, e0), (t1, e1) in zip(points, points[1:]):
        if e0 >= target >= e1 and e0 > e1:
            share = np.log(e0 / target) / np.log(e0 / e1)
            return t0 * (t1 / t0) ** share, "between two runs"
    if points[0][1] <= target:
        return points[0][0], "at the fewest samples, so at most that"
    t, e = points[-1]
    return t * (e / target) ** 2, "further than measured: four times the samples halve the error"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path, help="a glTF file; lights: points, suns, emissive surfaces")
    parser.add_argument("truth", type=Path, help="its truth: tools/truth/*.json*")
    parser.add_argument("--rebake", type=Path, required=True, help="the binary")
    parser.add_argument("--texels", default="512x512")
    parser.add_argument("--threads", type=int, default=2, help="of both; lavapipe's too")
    parser.add_argument("--quality", default="draft,preview", help="rebake's presets")
    parser.add_argument("--samples", default="16,64,256", help="Cycles' samples a texel, rising")
    parser.add_argument("--repeats", type=int, default=3, help="bakes a preset; the median counts")
    parser.add_argument("--target", type=float, default=2.2, help="median error, percent")
    parser.add_argument("--at-least", type=float, metavar="RATIO", help="fail unless rebake is so many times as fast")
    parser.add_argument("--keep", type=Path, help="leave both tools' maps in this folder")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        race(a, a.keep or Path(temporary))


def race(a, folder):
    """Runs both and prints the table."""
    folder.mkdir(parents=True, exist_ok=True)
    print(f"{a.scene.name}, {a.texels} texels, {a.threads} threads; load before: {os.getloadavg()[0]:.2f}")
    print(f"{'':28s} {'wall time':>11s} {'median':>8s} {'p95':>8s} {'bias':>8s}  (percent of the truth)", flush=True)
    ours = []
    for quality in a.quality.split(","):
        out, times = folder / quality, []
        for _ in range(a.repeats):
            start = time.perf_counter()
            command = [a.rebake, "bake", a.scene, "-o", out, "--texels", a.texels, "--quality", quality, "--quiet"]
            run(command + ["--threads", str(a.threads)], LP_NUM_THREADS=str(a.threads))
            times.append(time.perf_counter() - start)
        found = error(a.truth, out)
        ours.append((statistics.median(times), found["median"]))
        row(f"rebake, {quality}", ours[-1][0], found)
    atlas = folder / a.quality.split(",")[0]
    report = json.loads((atlas / "bake.json").read_text())
    size, theirs = report["atlas"]["page_size"], []
    cycles = folder / "cycles"
    cycles.mkdir(exist_ok=True)
    command = ["blender", "-b", "--factory-startup", "-noaudio", "--python-exit-code", "1", "--python", HERE / "bake.py", "--"]
    out = run(command + [atlas / "scene.glb", cycles, str(a.threads), str(size), *a.samples.split(",")])
    for line in out.splitlines():
        if not line.startswith("cycles "):
            continue
        told = json.loads(line[7:])
        page = np.fromfile(cycles / f"{told['samples']}.f32", "<f4").reshape(size, size, 3)
        exr.write(cycles / "lightmap_0.exr", page)
        (cycles / "scene.glb").write_bytes((atlas / "scene.glb").read_bytes())
        found = error(a.truth, cycles)
        theirs.append((told["seconds"], found["median"]))
        row(f"Cycles {told['blender']}, {told['samples']} samples", told["seconds"], found)
    good = [o for o in ours if o[1] <= a.target]
    if not good:
        raise SystemExit(f"no preset of rebake comes to {a.target} %")
    best, (needs, how) = min(good), seconds_to(theirs, a.target)
    ratio = needs / best[0]
    print(f"to {a.target} %: Cycles {needs:.1f} s ({how}; its bake alone), rebake {best[0]:.2f} s (the whole process) at {best[1]:.2f} %")
    print(f"rebake is {ratio:.1f} times as fast")
    if a.at_least and ratio < a.at_least:
        raise SystemExit(f"FAIL: {a.at_least} times was asked for")


if __name__ == "__main__":
    main()
