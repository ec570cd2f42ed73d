#!/usr/bin/env python3
"""Checks the truth itself against closed forms: a point light, a spot, a sun, a square emitter, and furnaces."""

import base64
import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

import gltf
from tracer import Tracer


def quad(center, u, v):
    """A rectangle with half sides u and v, front towards u x v."""
    c, u, v = (np.array(x, float) for x in (center, u, v))
    return np.array([c - u - v, c + u - v, c + u + v, c - u + v])


def scene(quads, materials, lights=()):
    """A glTF of rectangles `(corners, material)` and lights `(definition, node)`, read back through the reader."""
    blob, views, accessors, meshes, nodes = b"", [], [], [], []

    def add(array, kind, component):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind})
        blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(accessors) - 1

    for corners, material in quads:
        position = add(corners.astype("<f4"), "VEC3", 5126)
        index = add(np.array([0, 1, 2, 0, 2, 3], "<u2"), "SCALAR", 5123)
        meshes.append({"primitives": [{"attributes": {"POSITION": position}, "indices": index, "material": material}]})
        nodes.append({"mesh": len(meshes) - 1})
    for i, (_, node) in enumerate(lights):
        nodes.append(node | {"extensions": {"KHR_lights_punctual": {"light": i}}})
    doc = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob), "uri": "data:;base64," + base64.b64encode(blob).decode()}],
        "extensions": {"KHR_lights_punctual": {"lights": [light for light, _ in lights]}},
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.gltf"
        path.write_text(json.dumps(doc))
        return gltf.load(path)


def material(albedo, emission=0.0, **more):
    """A grey diffuse material."""
    return {
        "pbrMetallicRoughness": {"baseColorFactor": [albedo] * 3 + [1]},
        "emissiveFactor": [1.0 if emission else 0.0] * 3,
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": emission}},
    } | more


def irradiance(scene, points, normals, rounds=64, side=16):
    """Mean and standard error of the mean of total irradiance (all channels averaged)."""
    t = Tracer(scene)
    points, normals = np.array(points, float), np.array(normals, float)
    exact = t.punctual_direct(points, normals, normals)
    batches = []
    for r in range(rounds):
        d, b = t.round(points, normals, normals, side, r)
        batches.append((exact + d + b).mean(1))
    batches = np.array(batches)
    return batches.mean(0), batches.std(0, ddof=1) / math.sqrt(rounds)


failed = 0


def expect(name, got, error, want, tolerance):
    """Prints and keeps score: within the tolerance plus four standard errors."""
    global failed
    worst = np.max(np.abs(got / want - 1) - 4 * error / want)
    ok = worst <= tolerance and np.max(4 * error / want) <= 0.05
    failed += not ok
    print(f"{'ok  ' if ok else 'FAIL'} {name}: mean {np.mean(got):.6g}, expected {np.mean(want):.6g}, "
          f"largest standard error {100 * np.max(error / want):.2g} %")


def cube(inside, half=1.0):
    """Six rectangles of a cube, fronts inwards, all of one material."""
    e = np.eye(3) * half
    out = []
    for axis in range(3):
        for sign in (-1, 1):
            u, v = e[(axis + 1) % 3], e[(axis + 2) % 3]
            out.append((quad(sign * e[axis], *((u, v) if sign < 0 else (v, u))), inside))
    return out


def main():
    up = [0, 1, 0]
    floor = (quad([0, 0, 0], [0, 0, 5], [5, 0, 0]), 0)
    at = np.array([[x, 0, z] for x in np.linspace(-2, 2, 9) for z in (-1.5, 0.2, 1.0)])
    ups = np.tile(up, (len(at), 1))

    got, se = irradiance(
        scene([floor], [material(0.5)], [({"type": "point", "intensity": 80, "color": [1, 0.5, 0.25]}, {"translation": [0.3, 2, 0]})]), at, ups, 2
    )
    d = np.array([0.3, 2, 0]) - at
    expect("point light over a plane", got, se, 80 * 1.75 / 3 * d[:, 1] / np.linalg.norm(d, axis=1) ** 3, 1e-5)

    s = math.sqrt(0.5)
    down = {"translation": [0, 2, 0], "rotation": [-s, 0, 0, s]}
    got, se = irradiance(scene([floor], [material(0.5)], [({"type": "directional", "intensity": 3}, down)]), at, ups, 2)
    expect("sun over a plane", got, se, np.full(len(at), 3.0), 1e-5)

    spot = {"type": "spot", "intensity": 100, "spot": {"innerConeAngle": 0.3, "outerConeAngle": 1.5}}
    got, se = irradiance(scene([floor], [material(0.5)], [(spot, down)]), at, ups, 2)
    d = np.array([0, 2, 0]) - at
    cos = d[:, 1] / np.linalg.norm(d, axis=1)
    fall = np.clip((cos - math.cos(1.5)) / (math.cos(0.3) - math.cos(1.5)), 0, 1) ** 2
    expect("spot light over a plane", got, se, 100 * fall * cos / (d**2).sum(1), 1e-5)

    # Form factor of a parallel rectangle above a corner, four times (Siegel and Howell, configuration B-4).
    lamp = (quad([0, 1, 0], [0.5, 0, 0], [0, 0, 0.5]), 1)
    for name, m in (("", material(0, 20.0)), (", double-sided", material(0, 20.0, doubleSided=True))):
        got, se = irradiance(scene([floor, lamp], [material(0), m]), at, ups)

        def corner(a, b):
            x, y = a, b
            p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
            return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * math.pi)

        x, z = at[:, 0], at[:, 2]
        f = corner(0.5 - x, 0.5 - z) + corner(0.5 + x, 0.5 - z) + corner(0.5 - x, 0.5 + z) + corner(0.5 + x, 0.5 + z)
        expect(f"square emitter over a plane{name}", got, se, 20 * math.pi * f, 1e-3)

    rng = np.random.default_rng(1)
    inside = rng.uniform(-1, 1, (24, 3))
    normals = np.zeros((24, 3))
    inside[np.arange(24), np.arange(24) % 3] = np.where(np.arange(24) % 2, 1.0, -1.0)
    normals[np.arange(24), np.arange(24) % 3] = np.where(np.arange(24) % 2, -1.0, 1.0)
    for rho in (0.0, 0.5, 0.8):
        got, se = irradiance(scene(cube(0), [material(rho, 1.0)]), inside, normals)
        expect(f"furnace, albedo {rho}", got, se, np.full(24, math.pi / (1 - rho)), 2e-3)

    # A point light in a closed box: flux balance, mean irradiance = flux / (area (1 - albedo)).
    points = rng.uniform(-1, 1, (1536, 3))
    axis, sign = np.arange(1536) % 3, np.where(np.arange(1536) // 3 % 2, 1.0, -1.0)
    normals = np.zeros((1536, 3))
    points[np.arange(1536), axis] = sign
    normals[np.arange(1536), axis] = -sign
    lamp = ({"type": "point", "intensity": 10}, {"translation": [0, 0, 0]})
    got, _ = irradiance(scene(cube(0), [material(0.5)], [lamp]), points, normals, 4)
    mean, error = np.array([got.mean()]), np.array([got.std() / math.sqrt(len(got))])
    expect("flux balance in a closed box", mean, error, np.array([4 * math.pi * 10 / 24 / 0.5]), 1e-3)

    # What lies behind a single-sided wall stays dark; behind a double-sided one as well, but it reflects.
    wall = (quad([0, 1, 0], [0, 0, 5], [5, 0, 0]), 0)
    lamp = ({"type": "point", "intensity": 80}, {"translation": [0, 0.5, 0]})
    got, se = irradiance(scene([floor, wall], [material(0.0), material(0.5)], [lamp]), [[0, 1, 0]], [up], 4)
    global failed
    failed += got[0] != 0
    single, _ = irradiance(scene([floor, (wall[0], 1)], [material(0.0), material(0.5)], [lamp]), [[0, 0, 0]], [up], 16)
    double, _ = irradiance(
        scene([floor, (wall[0], 1)], [material(0.0), material(0.5, doubleSided=True)], [lamp]), [[0, 0, 0]], [up], 16
    )
    failed += not (single[0] == 320.0 and double[0] > 330.0)
    print(f"walls: behind {got[0]}, under a single-sided wall {single[0]:.5g}, under a double-sided one {double[0]:.5g}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
