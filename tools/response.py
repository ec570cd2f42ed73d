#!/usr/bin/env python3
"""How fast the map follows an edit: plays scripts with `rebake replay --rebake` and prints two tables.

    tools/response.py [--rebake PATH] [--scene FILE.glb] [--options "--texels 1M"] [--plots FOLDER] assets/replay/museum-move.jsonl ...

Without --scene the scene is the built-in one that a script's name begins with. Shares are of the RMS difference from the converged map in
what a camera sees (VIEWS, or the scene's own) before the first update; a second share is of all texels, and a third that of a full rebake at
the same moment, which begins with a dark map. `95 % gone` is the moment after which the share stays below 5 %; `full rebake` is the time
that a rebake of the edited scene needs from its first light to the same map. The second table ends with how far the mean, and single texels, leave on
the way what lies between their first and last values: flicker, where an edit only dims. --plots keeps the curves as SCRIPT.png. Needs nothing but Python.
"""

import argparse
import bisect
import csv
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile

# Position and target of cameras that see what a script edits.
VIEWS = {
    "museum": (-8.8, 2.2, -10.5, -14.5, 1.2, -15.5),
}


def play(rebake, scene, script, options, out):
    subprocess.run([rebake, "replay", scene, script, "-o", out, "-q", "--rebake", *options], check=True)
    with open(os.path.join(out, "replay.json")) as file:
        report = json.load(file)
    with open(os.path.join(out, "bake.json")) as file:
        bake = json.load(file)
    with open(os.path.join(out, "convergence.csv")) as file:
        rows = list(csv.DictReader(file))
    return report, bake, rows


class Curve:
    """Shares over updates and seconds, from before the first update on."""

    def __init__(self, seconds, updates, share):
        self.seconds, self.updates, self.share = seconds, updates, share

    def after(self, axis, at):
        return self.share[max(bisect.bisect_right(axis, at) - 1, 0)]

    def gone(self, left):
        """Seconds until no later share is above `left`."""
        last = max((i for i, s in enumerate(self.share) if s > left), default=-1) + 1
        return self.seconds[min(last, len(self.seconds) - 1)]


def curves(report, rows):
    seconds = [float(r["seconds"]) for r in rows]
    updates = list(range(len(rows)))
    viewport = Curve(seconds, updates, [float(r["viewport share"]) for r in rows])
    whole = Curve(seconds, updates, [float(r["RMS share"]) for r in rows])
    first = report["replay"]["initial_viewport"]
    moments = report["rebake"]
    again = Curve(
        [m["seconds"] for m in moments],
        [m["updates"] for m in moments],
        [m["viewport"] / max(first, 1e-30) for m in moments],
    )
    return viewport, whole, again


def percent(x):
    return f"{100 * x:.1f}" if x < 1 else f"{100 * x:.0f}"


UPDATES, SECONDS = (10, 30, 100, 300), (1, 2, 5)


def row(name, report, bake, rows):
    viewport, whole, again = curves(report, rows)
    full = again.seconds[-1]
    t95 = viewport.gone(0.05)
    three = lambda of: " / ".join(percent(of(c)) for c in (viewport, whole, again))
    return [
        name,
        *(three(lambda c: c.after(c.updates, n)) for n in UPDATES),
        *(three(lambda c: c.after(c.seconds, t)) for t in SECONDS),
        f"{t95:.2f}",
        f"{full:.1f}",
        percent(t95 / full),
        percent(whole.gone(0.05) / full),
        percent(again.gone(0.05) / full),
    ]


HEAD = [
    "scenario: viewport / map / rebake, %",
    *(f"{n} updates" for n in UPDATES),
    *(f"{t} s" for t in SECONDS),
    "95 % gone after s",
    "full rebake s",
    "of a full rebake %",
    "the map's",
    "the rebake's own",
]


def row_of_updates(name, report, bake, rows):
    """In the form of IBGI's Table 1."""
    replay, counts = report["replay"], bake["counts"]
    lights = sum(counts["virtual_lights"].values())
    updates = max(replay["updates"], 1)
    seconds = max(replay["seconds"], 1e-9)
    column = lambda key: sum(float(r[key]) for r in rows)
    evaluated = column("lights subtracted") + column("lights added")
    limited = column("lights limited")
    moments = report["rebake"]
    return [
        name,
        f"{counts['triangles']}",
        f"{counts['texels']}",
        f"{counts['paths']}",
        f"{counts['vpls']}",
        f"{counts['clusters']}",
        f"{lights}",
        f"{1e3 * moments[-1]['seconds'] / max(lights, 1):.1f}",
        f"{replay['updates']}",
        f"{updates / seconds:.0f}",
        f"{evaluated / updates:.1f} + {limited / updates:.1f}",
        f"{1e3 * seconds / max(evaluated + 2 * limited, 1):.1f}",
        f"{seconds:.1f}",
        *strays(replay, rows),
    ]


def strays(replay, rows):
    """How far means and texels leave what lies between their first and last values: the mean at most, shares of the larger mean."""
    means = [float(r["mean [lux]"]) for r in rows]
    low, high = sorted((means[0], means[-1]))
    most = max(high, 1e-30)
    beyond = [float(r["beyond both ends [lux]"]) / most for r in rows]
    outside = max(max(means) - high, low - min(means), 0) / most
    return f"{100 * outside:.2f}", f"{100 * max(beyond):.1f}", str(sum(b > 0.02 for b in beyond))


HEAD_OF_UPDATES = [
    "scenario",
    "triangles",
    "texels",
    "paths",
    "VPLs",
    "cells",
    "virtual lights",
    "ms a light, full rebake",
    "updates",
    "updates/s",
    "lights an update: whole + limited",
    "ms a light",
    "converged s",
    "mean outside of both ends %",
    "a texel at most, % of the mean",
    "updates with one more than 2 %",
]


def table(head, rows):
    print("| " + " | ".join(head) + " |")
    print("|" + " --- |" * len(head))
    for cells in rows:
        print("| " + " | ".join(cells) + " |")
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rebake", default="target/release/rebake")
    parser.add_argument("--scene")
    parser.add_argument("--options", default="")
    parser.add_argument("--plots")
    parser.add_argument("scripts", nargs="+")
    arguments = parser.parse_args()
    response, updates = [], []
    with tempfile.TemporaryDirectory() as folder:
        for script in arguments.scripts:
            name = os.path.basename(script).removesuffix(".jsonl")
            built_in = name.rsplit("-", 1)[0]
            scene = arguments.scene
            if scene is None:
                scene = os.path.join(folder, built_in + ".glb")
                if not os.path.exists(scene):
                    subprocess.run([arguments.rebake, "scene", built_in, "-o", scene, "-q"], check=True)
            options = shlex.split(arguments.options)
            view = VIEWS.get(name, VIEWS.get(built_in))
            if view is not None and "--camera" not in options:
                options += ["--camera", ",".join(str(x) for x in view)]
            out = os.path.join(folder, "out")
            result = play(arguments.rebake, scene, script, options, out)
            if arguments.plots:
                os.makedirs(arguments.plots, exist_ok=True)
                shutil.copyfile(os.path.join(out, "convergence.png"), os.path.join(arguments.plots, name + ".png"))
            response.append(row(name, *result))
            updates.append(row_of_updates(name, *result))
            # Should a later script fail, this is known.
            print(f"{name}: " + "; ".join(f"{what} {value}" for what, value in zip(HEAD[1:], response[-1][1:])), file=sys.stderr)
    table(HEAD, response)
    table(HEAD_OF_UPDATES, updates)


if __name__ == "__main__":
    main()
