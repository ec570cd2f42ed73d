"""Bakes irradiance with Blender's Cycles into the atlas that rebake made: `blender -b --python bake.py -- SCENE.GLB OUT THREADS SAMPLES...`.

SCENE.GLB is what `rebake bake` wrote. All of it becomes one mesh of single triangles with one image, so that Cycles builds its
tree once. For every number of samples writes OUT/SAMPLES.f32 (RGB, top row first, lux) and prints a line of JSON.

Units: glTF's candela, lux and cd/m^2 go in as watts of the same number, so that nothing is converted: a point of I cd gets 4 pi I
watts (Cycles shines energy / (4 pi) per steradian), a sun of E lx a strength of E, a surface of L cd/m^2 an emission of L.
The diffuse pass without colour is radiance over albedo, E / pi. Surfaces are what rebake takes them for: diffuse, lit and shining on the
front alone unless the material is double-sided, opaque to both sides, cut out where alpha is below the cutoff.
"""

import json
import math
import sys
import time
from pathlib import Path

import bpy
import mathutils
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "truth"))
import gltf  # noqa: E402


def lightmap_coordinates(path):
    """`[T, 3, 2]` of the atlas in the order of `gltf.load`, and the pages that materials name."""
    file = gltf.File(path)
    parts, pages = [], set()
    for node, _ in file.world():
        n = file.json["nodes"][node]
        for p in file.json["meshes"][n["mesh"]]["primitives"] if "mesh" in n else []:
            index = file.triangles(p)
            if len(index) == 0:
                continue
            lightmap = file.json["materials"][p["material"]]["extensions"]["MOZ_lightmap"]
            pages.add(lightmap["index"])
            parts.append(file.accessor(p["attributes"][f"TEXCOORD_{lightmap.get('texCoord', 1)}"])[index])
    if len(pages) != 1:
        raise SystemExit(f"{path}: {len(pages)} lightmap pages, Cycles bakes into one image: give rebake a larger --page-size")
    return np.concatenate(parts)


def image(name, pixels, color):
    """An image of bytes, top row first."""
    h, w = pixels.shape[:2]
    made = bpy.data.images.new(name, w, h, alpha=True)
    made.colorspace_settings.name = "sRGB" if color else "Non-Color"
    made.alpha_mode = "CHANNEL_PACKED"
    made.pixels.foreach_set((pixels[::-1].astype(np.float32) / 255).ravel())
    made.pack()
    return made


def material(name, m, images, target):
    """Cycles' nodes of a material."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()

    def node(kind, **inputs):
        new = nodes.new(kind)
        for key, value in inputs.items():
            if isinstance(value, bpy.types.NodeSocket):
                links.new(value, new.inputs[key])
            else:
                new.inputs[key].default_value = value
        return new

    def lookup(texture, layer):
        uv = nodes.new("ShaderNodeUVMap")
        uv.uv_map = layer
        t = node("ShaderNodeTexImage", Vector=uv.outputs[0])
        t.image = images[texture["image"]]
        t.extension = "REPEAT" if texture["wrap"][0] == 0 else "EXTEND"
        return t

    def times(a, b):
        new = nodes.new("ShaderNodeVectorMath")
        new.operation = "MULTIPLY"
        links.new(a, new.inputs[0])
        new.inputs[1].default_value = b
        return new.outputs[0]

    albedo, alpha = (*m.albedo[:3], 1.0), float(m.albedo[3])
    if m.albedo_texture:
        t = lookup(m.albedo_texture, "albedo")
        albedo, alpha = times(t.outputs["Color"], m.albedo[:3]), t.outputs["Alpha"]
    surface = node("ShaderNodeBsdfDiffuse", Color=albedo).outputs[0]
    if m.emission.any():
        color = (*m.emission, 1.0)
        if m.emission_texture:
            color = times(lookup(m.emission_texture, "emission").outputs["Color"], m.emission)
        light = node("ShaderNodeEmission", Color=color, Strength=1.0)
        both = nodes.new("ShaderNodeAddShader")
        links.new(surface, both.inputs[0])
        links.new(light.outputs[0], both.inputs[1])
        surface = both.outputs[0]

    def mix(factor, a, b):
        new = nodes.new("ShaderNodeMixShader")
        links.new(factor, new.inputs[0])
        links.new(a, new.inputs[1])
        links.new(b, new.inputs[2])
        return new.outputs[0]

    if not m.double_sided:
        black = node("ShaderNodeBsdfDiffuse", Color=(0, 0, 0, 1))
        surface = mix(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], surface, black.outputs[0])
    if m.cutoff > 0:
        there = nodes.new("ShaderNodeMath")
        there.operation = "GREATER_THAN"
        if isinstance(alpha, bpy.types.NodeSocket):
            factor = nodes.new("ShaderNodeMath")
            factor.operation = "MULTIPLY"
            links.new(alpha, factor.inputs[0])
            factor.inputs[1].default_value = float(m.albedo[3])
            links.new(factor.outputs[0], there.inputs[0])
        else:
            there.inputs[0].default_value = alpha
        there.inputs[1].default_value = m.cutoff - 1e-6
        surface = mix(there.outputs[0], nodes.new("ShaderNodeBsdfTransparent").outputs[0], surface)
    links.new(surface, nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    # What is baked goes to the active image node.
    into = nodes.new("ShaderNodeTexImage")
    into.image = target
    nodes.active = into
    return made


def mesh(scene, atlas, materials):
    """One object of single triangles."""
    count = len(scene.position)
    made = bpy.data.meshes.new("scene")
    made.vertices.add(3 * count)
    made.vertices.foreach_set("co", scene.position.astype(np.float32).ravel())
    made.loops.add(3 * count)
    made.loops.foreach_set("vertex_index", np.arange(3 * count, dtype=np.int32))
    made.polygons.add(count)
    made.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    made.polygons.foreach_set("loop_total", np.full(count, 3, np.int32))
    made.polygons.foreach_set("use_smooth", np.ones(count, bool))
    used, slot = np.unique(scene.material, return_inverse=True)
    for m in used:
        made.materials.append(materials[m])
    made.polygons.foreach_set("material_index", slot.astype(np.int32))
    for name, uv in (("albedo", scene.uv[:, 0]), ("emission", scene.uv[:, 1]), ("atlas", atlas)):
        flipped = np.array(uv, np.float32)
        flipped[..., 1] = 1 - flipped[..., 1]
        made.uv_layers.new(name=name).data.foreach_set("uv", flipped.ravel())
    made.uv_layers.active = made.uv_layers["atlas"]
    made.update()
    made.use_auto_smooth = True
    made.auto_smooth_angle = math.pi
    face = np.repeat(scene.face[:, None], 3, 1)
    # As rebake: the vertex normal where there is one that is not turned away.
    seen = (scene.normal * face).sum(2, keepdims=True) > 0
    made.normals_split_custom_set(np.where(seen, scene.normal, face).reshape(-1, 3).tolist())
    thing = bpy.data.objects.new("scene", made)
    bpy.context.collection.objects.link(thing)
    return thing


def light(number, l):
    """A punctual light; its colour carries the ratio of its channels."""
    strength = float(l.intensity.max())
    if strength <= 0:
        return
    kind = {"point": "POINT", "directional": "SUN"}.get(l.kind)
    if kind is None:
        raise SystemExit(f"light {number}: Blender's spots fall off otherwise than glTF's, so the two cannot be compared")
    made = bpy.data.lights.new(f"light {number}", kind)
    made.color = (l.intensity / strength).tolist()
    made.energy = strength * (4 * math.pi if kind == "POINT" else 1.0)
    if kind == "POINT":
        made.shadow_soft_size = 0.0
    else:
        made.angle = 0.0
    thing = bpy.data.objects.new(made.name, made)
    turn = mathutils.Vector((0, 0, -1)).rotation_difference(mathutils.Vector(l.direction.tolist()))
    thing.matrix_world = mathutils.Matrix.Translation(l.position.tolist()) @ turn.to_matrix().to_4x4()
    bpy.context.collection.objects.link(thing)


def settle(threads):
    """Cycles without anything that trades bias for speed."""
    scene = bpy.context.scene
    scene.world = None
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    c = scene.cycles
    c.device = "CPU"
    c.use_adaptive_sampling = c.use_denoising = False
    c.max_bounces = c.diffuse_bounces = 16
    c.transparent_max_bounces = 64
    c.sample_clamp_direct = c.sample_clamp_indirect = 0.0
    c.light_sampling_threshold = 0.0
    c.blur_glossy = 0.0
    b = scene.render.bake
    b.use_pass_direct = b.use_pass_indirect = True
    b.use_pass_color = False
    b.use_clear, b.margin, b.margin_type = True, 4, "EXTEND"


def main():
    path, out, threads, size, *samples = sys.argv[sys.argv.index("--") + 1 :]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, atlas = gltf.load(path), lightmap_coordinates(path)
    target = bpy.data.images.new("lightmap", int(size), int(size), alpha=False, float_buffer=True)
    target.colorspace_settings.name = "Non-Color"
    textures = [m.albedo_texture for m in scene.materials] + [m.emission_texture for m in scene.materials]
    used = {t["image"] for t in textures if t}
    images = {i: image(f"image {i}", scene.images[i], True) for i in used}
    materials = [material(f"material {i}", m, images, target) for i, m in enumerate(scene.materials)]
    thing = mesh(scene, atlas, materials)
    for number, l in enumerate(scene.lights):
        light(number, l)
    settle(int(threads))
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    for n in samples:
        bpy.context.scene.cycles.samples = int(n)
        start = time.perf_counter()
        bpy.ops.object.bake(type="DIFFUSE")
        seconds = time.perf_counter() - start
        pixels = np.empty(4 * int(size) ** 2, np.float32)
        target.pixels.foreach_get(pixels)
        rgb = math.pi * pixels.reshape(int(size), int(size), 4)[::-1, :, :3]
        rgb.astype("<f4").tofile(Path(out) / f"{n}.f32")
        print("cycles " + json.dumps({"samples": int(n), "seconds": seconds, "blender": bpy.app.version_string}), flush=True)


main()
