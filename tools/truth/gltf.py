"""Reads a glTF scene into flat numpy arrays, for the truth and its comparison; shares no code with rebake itself.

World space, metres. Triangles keep the file's order: node by node (only nodes that have a mesh), primitive by
primitive, triangle by triangle; degenerate ones stay, so that an index means the same triangle everywhere.
"""

import base64
import io
import json
import math
import struct
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

import numpy as np

COMPONENT = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
WRAP = {10497: 0, 33071: 1, 33648: 2}  # repeat, clamp, mirror


class File:
    """The JSON of a .gltf or .glb, and its accessors as arrays."""

    def __init__(self, path):
        self.path = Path(path)
        data = self.path.read_bytes()
        self.chunk = None
        if data[:4] == b"glTF":
            at = 12
            while at + 8 <= len(data):
                length, kind = struct.unpack_from("<II", data, at)
                body = data[at + 8 : at + 8 + length]
                if kind == 0x4E4F534A:
                    self.json = json.loads(body)
                elif kind == 0x004E4942:
                    self.chunk = body
                at += 8 + (length + 3) // 4 * 4
        else:
            self.json = json.loads(data)
        self.buffers = {}

    def uri(self, uri):
        """The bytes a URI names."""
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.path.parent / unquote(uri)).read_bytes()

    def buffer(self, i):
        """The bytes of a buffer."""
        if i not in self.buffers:
            uri = self.json["buffers"][i].get("uri")
            self.buffers[i] = self.chunk if uri is None else self.uri(uri)
        return self.buffers[i]

    def view(self, i):
        """The bytes of a buffer view and its stride."""
        v = self.json["bufferViews"][i]
        start = v.get("byteOffset", 0)
        return self.buffer(v["buffer"])[start : start + v["byteLength"]], v.get("byteStride")

    def accessor(self, i):
        """An accessor's elements, `[count, width]`; normalised integers as floats."""
        a = self.json["accessors"][i]
        kind, width, count = np.dtype("<" + COMPONENT[a["componentType"]]), WIDTH[a["type"]], a["count"]

        def read(view, offset, kind, count, width):
            data, stride = self.view(view)
            stride = stride or kind.itemsize * width
            rows = np.lib.stride_tricks.as_strided(
                np.frombuffer(data, np.uint8)[offset:], (count, kind.itemsize * width), (stride, 1)
            )
            return np.ascontiguousarray(rows).view(kind).reshape(count, width)

        if "bufferView" in a:
            out = read(a["bufferView"], a.get("byteOffset", 0), kind, count, width)
        else:
            out = np.zeros((count, width), kind)
        if "sparse" in a:
            s = a["sparse"]
            where, what = s["indices"], s["values"]
            index = read(where["bufferView"], where.get("byteOffset", 0), np.dtype("<" + COMPONENT[where["componentType"]]), s["count"], 1)
            out = out.copy()
            out[index[:, 0]] = read(what["bufferView"], what.get("byteOffset", 0), kind, s["count"], width)
        if a.get("normalized"):
            out = np.maximum(out.astype(np.float64) / np.iinfo(kind).max, -1.0)
        return out

    def image(self, i):
        """An image as `[height, width, 4]` bytes, top row first."""
        from PIL import Image

        im = self.json["images"][i]
        data = self.uri(im["uri"]) if "uri" in im else self.view(im["bufferView"])[0]
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))

    def world(self):
        """`[(node, matrix 4x4)]` of the default scene, in the order of node indices."""
        nodes = self.json.get("nodes", [])
        out = {}
        scenes = self.json.get("scenes")
        if scenes:
            roots = scenes[self.json.get("scene", 0)].get("nodes", [])
        else:
            roots = range(len(nodes))
        stack = [(r, np.eye(4)) for r in roots]
        while stack:
            i, parent = stack.pop()
            out[i] = parent @ local(nodes[i])
            stack += [(c, out[i]) for c in nodes[i].get("children", [])]
        return sorted(out.items())

    def triangles(self, primitive):
        """`[count, 3]` vertex indices of a primitive, in the order that the glTF specification gives strips and fans."""
        count = self.json["accessors"][primitive["attributes"]["POSITION"]]["count"]
        if "indices" in primitive:
            index = self.accessor(primitive["indices"])[:, 0].astype(np.int64)
        else:
            index = np.arange(count)
        mode = primitive.get("mode", 4)
        if mode == 4:
            return index[: len(index) // 3 * 3].reshape(-1, 3)
        i = np.arange(max(len(index) - 2, 0))
        if mode == 5:
            return np.stack([index[i], index[i + 1 + i % 2], index[i + 2 - i % 2]], 1)
        if mode == 6:
            return np.stack([index[i + 1], index[i + 2], np.full(len(i), index[0])], 1)
        return np.zeros((0, 3), np.int64)


def local(node):
    """A node's own matrix."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    m = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), float)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, :3] *= np.array(node.get("scale", [1, 1, 1]), float)
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


@dataclass
class Material:
    """What diffuse transport reads of a material."""

    albedo: np.ndarray = field(default_factory=lambda: np.ones(4))
    emission: np.ndarray = field(default_factory=lambda: np.zeros(3))  # cd/m^2
    albedo_texture: dict | None = None
    emission_texture: dict | None = None
    double_sided: bool = False
    cutoff: float = 0.0  # below it light passes; 0: opaque


@dataclass
class Light:
    """A punctual light; intensity in candela, or lux where directional."""

    kind: str
    intensity: np.ndarray
    position: np.ndarray
    direction: np.ndarray  # that it shines into
    inner: float = 0.0
    outer: float = math.pi / 4


@dataclass
class Scene:
    """All triangles of a scene, in world space."""

    position: np.ndarray  # [T, 3, 3]
    normal: np.ndarray  # [T, 3, 3], zero where the file has none
    face: np.ndarray  # [T, 3], unit, towards the front; zero where degenerate
    area: np.ndarray  # [T]
    uv: np.ndarray  # [T, 2, 3, 2]: base colour's and emission's, KHR_texture_transform applied
    material: np.ndarray  # [T]
    node: np.ndarray  # [T]
    primitive: np.ndarray  # [T]
    triangle: np.ndarray  # [T], in its primitive
    materials: list
    lights: list
    images: list
    names: dict  # node -> name


def texture(gltf, info):
    """A textureInfo resolved: image, wrapping, coordinate set, and 3x2 matrix."""
    if info is None:
        return None
    t = gltf.json["textures"][info["index"]]
    sampler = gltf.json["samplers"][t["sampler"]] if "sampler" in t else {}
    move = info.get("extensions", {}).get("KHR_texture_transform", {})
    (ox, oy), (sx, sy), r = move.get("offset", [0, 0]), move.get("scale", [1, 1]), move.get("rotation", 0.0)
    c, s = math.cos(r), math.sin(r)
    # offset * rotation * scale of the extension's text, as row vectors: uv' = [u, v, 1] @ matrix.
    matrix = np.array([[c * sx, -s * sx], [s * sy, c * sy], [ox, oy]])
    return {
        "image": t["source"],
        "wrap": (WRAP[sampler.get("wrapS", 10497)], WRAP[sampler.get("wrapT", 10497)]),
        "set": move.get("texCoord", info.get("texCoord", 0)),
        "matrix": matrix,
    }


def load(path):
    """Reads a scene; `Scene`."""
    gltf = File(path)
    materials = [Material()]
    for m in gltf.json.get("materials", []):
        pbr, ext = m.get("pbrMetallicRoughness", {}), m.get("extensions", {})
        strength = ext.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        mode = m.get("alphaMode", "OPAQUE")
        materials.append(
            Material(
                albedo=np.array(pbr.get("baseColorFactor", [1, 1, 1, 1]), float),
                emission=np.array(m.get("emissiveFactor", [0, 0, 0]), float) * strength,
                albedo_texture=texture(gltf, pbr.get("baseColorTexture")),
                emission_texture=texture(gltf, m.get("emissiveTexture")),
                double_sided=m.get("doubleSided", False),
                cutoff={"OPAQUE": 0.0, "MASK": m.get("alphaCutoff", 0.5), "BLEND": 0.5}[mode],
            )
        )
    parts, lights, names = [], [], {}
    for node, world in gltf.world():
        n = gltf.json["nodes"][node]
        linear = world[:3, :3]
        light = n.get("extensions", {}).get("KHR_lights_punctual")
        if light is not None:
            lights.append(read_light(gltf.json["extensions"]["KHR_lights_punctual"]["lights"][light["light"]], world))
        if "mesh" not in n:
            continue
        names[node] = n.get("name", f"node {node}")
        sign = -1.0 if np.linalg.det(linear) < 0 else 1.0
        cofactor = np.linalg.inv(linear).T if abs(np.linalg.det(linear)) > 0 else linear
        for k, p in enumerate(gltf.json["meshes"][n["mesh"]]["primitives"]):
            index = gltf.triangles(p)
            if len(index) == 0:
                continue
            at = p["attributes"]
            local_position = gltf.accessor(at["POSITION"]).astype(float)
            position = (local_position @ linear.T + world[:3, 3])[index]
            normal = np.zeros_like(position)
            if "NORMAL" in at:
                normal = unit(gltf.accessor(at["NORMAL"]).astype(float) @ cofactor.T)[index]
            m = p.get("material", -1) + 1
            uv = np.zeros((len(index), 2, 3, 2))
            for slot, t in enumerate((materials[m].albedo_texture, materials[m].emission_texture)):
                if t and f"TEXCOORD_{t['set']}" in at:
                    c = gltf.accessor(at[f"TEXCOORD_{t['set']}"]).astype(float)
                    uv[:, slot] = (np.c_[c, np.ones(len(c))] @ t["matrix"])[index]
            cross = np.cross(position[:, 1] - position[:, 0], position[:, 2] - position[:, 0]) * sign
            count = len(index)
            parts.append(
                (position, normal, unit(cross), 0.5 * np.linalg.norm(cross, axis=1), uv)
                + tuple(np.full(count, v) for v in (m, node, k))
                + (np.arange(count),)
            )
    if not parts:
        raise SystemExit(f"{path}: no triangles")
    arrays = [np.concatenate(column) for column in zip(*parts)]
    used = {t["image"] for m in materials for t in (m.albedo_texture, m.emission_texture) if t}
    images = [gltf.image(i) if i in used else None for i in range(len(gltf.json.get("images", [])))]
    return Scene(*arrays, materials, lights, images, names)


def read_light(light, world):
    """A KHR_lights_punctual light as its node places it."""
    spot = light.get("spot", {})
    return Light(
        kind=light["type"],
        intensity=np.array(light.get("color", [1, 1, 1]), float) * light.get("intensity", 1.0),
        position=world[:3, 3],
        direction=unit(-world[:3, 2][None])[0],
        inner=spot.get("innerConeAngle", 0.0),
        outer=spot.get("outerConeAngle", math.pi / 4),
    )


def unit(v):
    """Unit vectors; zero stays zero."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, length, out=np.zeros_like(v), where=length > 0)
