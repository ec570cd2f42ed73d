#!/usr/bin/env python3
"""How fast the map follows an edit: plays scripts with `rebake replay` and prints a table.

    tools/response.py [--rebake PATH] [--scene FILE.glb] [--options "--texels 1M"] assets/replay/museum-move.jsonl ...

Without --scene the scene is the built-in one that a script's name begins with. The share of the error is the RMS difference from the
converged map over all texels, relative to that before the first update; `full bake` is everything but the unwrap: what a
rebake of the edited scene would have to do again. Needs nothing but Python.
"""

import argparse
import csv
import json
import os
import shlex
import subprocess
import sys
import tempfile


def play(rebake, scene, script, options, out):
    subprocess.run([rebake, "replay", scene, script, "-o", out, "-q", *options], check=True)
    with open(os.path.join(out, "replay.json")) as file:
        report = json.load(file)
    with open(os.path.join(out, "bake.json")) as file:
        bake = json.load(file)
    with open(os.path.join(out, "convergence.csv")) as file:
        rows = list(csv.DictReader(file))
    return report, bake, rows


def row(name, report, bake, rows):
    seconds = report["bake"]["seconds"]
    full = report["bake"]["total_seconds"] - seconds.get("unwrap", 0.0)
    share = [float(r["RMS share"]) for r in rows]
    time = [float(r["seconds"]) for r in rows]

    def after_updates(n):
        return share[min(n, len(share) - 1)]

    def after_seconds(t):
        return share[max(i for i in range(len(share)) if time[i] <= t)]

    # For good: no later update is above it.
    last = max((i for i, s in enumerate(share) if s > 0.05), default=-1) + 1
    t95 = time[min(last, len(time) - 1)]
    replay = report["replay"]
    updates = max(replay["updates"], 1)
    evaluated = sum(
        float(r["lights subtracted"]) + float(r["lights added"]) + 2 * float(r["lights limited"]) for r in rows
    )
    percent = lambda x: f"{100 * x:.1f}"
    return [
        name,
        f"{sum(bake['counts']['virtual_lights'].values())}",
        f"{full:.1f}",
        *(percent(after_updates(n)) for n in (10, 30, 100, 300)),
        *(percent(after_seconds(t)) for t in (1, 2, 5)),
        f"{t95:.2f}",
        percent(t95 / full),
        f"{replay['seconds']:.1f}",
        f"{updates / max(replay['seconds'], 1e-9):.0f}",
        f"{evaluated / updates:.1f}",
    ]


HEAD = [
    "scenario", "lights", "full bake s", "10 updates %", "30", "100", "300", "1 s %", "2 s", "5 s", "95 % gone after s",
    "% of a full bake", "converged s", "updates/s", "lights an update",
]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rebake", default="target/release/rebake")
    parser.add_argument("--scene")
    parser.add_argument("--options", default="")
    parser.add_argument("scripts", nargs="+")
    arguments = parser.parse_args()
    print("| " + " | ".join(HEAD) + " |")
    print("|" + " --- |" * len(HEAD))
    with tempfile.TemporaryDirectory() as folder:
        for script in arguments.scripts:
            name = os.path.basename(script).removesuffix(".jsonl")
            scene = arguments.scene
            if scene is None:
                built_in = name.rsplit("-", 1)[0]
                scene = os.path.join(folder, built_in + ".glb")
                if not os.path.exists(scene):
                    subprocess.run([arguments.rebake, "scene", built_in, "-o", scene, "-q"], check=True)
            result = play(
                arguments.rebake, scene, script, shlex.split(arguments.options), os.path.join(folder, "out")
            )
            print("| " + " | ".join(row(name, *result)) + " |")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
