"""Path-traced irradiance at surface points, unbiased, on Mitsuba 3's ray tracer and Dr.Jit's vector code.

Semantics: a single-sided surface blocks light from both sides and reflects and emits from its front alone, a double-sided
one does both from both; receivers use the normal they are given, and light from below their face counts nothing; bounces
leave on the face's normal; everything is diffuse. Where alpha is below a material's cutoff there is no surface.

Light reaches a vertex by sampling lights and by cosine-sampled rays that meet emitters, combined by the balance
heuristic (Veach 1997, section 9.2.2); paths end by Russian roulette.
"""

import os

import numpy as np

LLVM = "/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1"
if os.path.exists(LLVM):
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", LLVM)

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")

from mitsuba import Bool, Color3f, Float, Frame3f, Point2f, Point3f, Ray3f, UInt32, Vector3f  # noqa: E402

DEPTH = 512  # bounces; Russian roulette ends paths long before
ROULETTE = 4  # the first bounce at which a path may be ended
OFFSET = 2e-5  # how far rays start off a surface, relative to 1 + the largest coordinate


def flat(array, kind=Float):
    """A numpy array as one Dr.Jit array."""
    return kind(np.ascontiguousarray(array, dtype=np.uint32 if kind is UInt32 else np.float32).ravel())


def mesh(position):
    """A Mitsuba scene that holds these triangles in their order; none for none."""
    if len(position) == 0:
        return None
    m = mi.Mesh("triangles", 3 * len(position), len(position))
    p = mi.traverse(m)
    p["vertex_positions"] = flat(position)
    p["faces"] = flat(np.arange(3 * len(position)), UInt32)
    p.update()
    return mi.load_dict({"type": "scene", "mesh": m})


class Textures:
    """One slot of every material (albedo or emission): a factor, and a texture in one table of packed sRGB texels."""

    def __init__(self, scene, factors, textures):
        offset, table, at = {}, [], 0
        for t in textures:
            if t and t["image"] not in offset:
                offset[t["image"]] = at
                table.append(scene.images[t["image"]].astype(np.uint32) @ np.array([1, 256, 65536, 16777216], np.uint32))
                table[-1] = table[-1].ravel()
                at += len(table[-1])
        self.used = bool(table)
        self.table = flat(np.concatenate(table) if table else np.zeros(1), UInt32)
        rows = []
        for t in textures:
            if t:
                h, w = scene.images[t["image"]].shape[:2]
                rows.append((offset[t["image"]], w, h, t["wrap"][0] + 4 * t["wrap"][1]))
            else:
                rows.append((0, 0, 0, 0))
        self.rows = flat(rows, UInt32)
        self.factor = flat(np.pad(factors, ((0, 0), (0, 4 - np.shape(factors)[1])), constant_values=1))
        s = np.arange(256) / 255
        self.linear = flat(np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4))

    def wrap(self, mode, i, size):
        """A texel index brought inside 0..size."""
        n = dr.maximum(mi.Int32(size), 1)
        m = i - n * dr.int_array_t(Float)(dr.floor(Float(i) / Float(n)))
        twice = i - 2 * n * dr.int_array_t(Float)(dr.floor(Float(i) / Float(2 * n)))
        mirror = dr.select(twice < n, twice, 2 * n - 1 - twice)
        return UInt32(dr.clip(dr.select(mode == 0, m, dr.select(mode == 2, mirror, i)), 0, n - 1))

    def eval(self, material, uv, active):
        """Linear RGBA at a texture coordinate: bilinear, colours decoded from sRGB first."""
        f = dr.gather(mi.Vector4f, self.factor, material, active)
        if not self.used:
            return Color3f(f.x, f.y, f.z), f.w
        row = dr.gather(mi.Vector4u, self.rows, material, active)
        textured = active & (row.y > 0)
        x, y = uv.x * row.y - 0.5, uv.y * row.z - 0.5
        x0, y0 = dr.floor(x), dr.floor(y)
        fx, fy = x - x0, y - y0
        rgb, alpha = Color3f(0), Float(0)
        for dx, wx in ((0, 1 - fx), (1, fx)):
            for dy, wy in ((0, 1 - fy), (1, fy)):
                ix = self.wrap(row.w & 3, mi.Int32(x0) + dx, row.y)
                iy = self.wrap(row.w >> 2, mi.Int32(y0) + dy, row.z)
                t = dr.gather(UInt32, self.table, row.x + iy * row.y + ix, textured)
                w = wx * wy
                rgb += w * Color3f(*(dr.gather(Float, self.linear, (t >> s) & 255, textured) for s in (0, 8, 16)))
                alpha += w * (Float(t >> 24) / 255)
        rgb = dr.select(textured, rgb, Color3f(1))
        alpha = dr.select(textured, alpha, 1)
        return rgb * Color3f(f.x, f.y, f.z), alpha * f.w


class Tracer:
    """A scene ready to be sampled."""

    def __init__(self, scene):
        m = scene.materials
        self.albedo = Textures(scene, [x.albedo for x in m], [x.albedo_texture for x in m])
        self.emission = Textures(scene, [x.emission for x in m], [x.emission_texture for x in m])
        self.cutoff = flat([x.cutoff for x in m])
        self.double = flat([x.double_sided for x in m], UInt32)
        cut = np.array([x.cutoff > 0 for x in m])[scene.material]
        self.all = mesh(scene.position)
        self.masked = mesh(scene.position[cut])
        self.opaque = mesh(scene.position[~cut]) if cut.any() else self.all
        self.masked_index = flat(np.flatnonzero(cut), UInt32)
        self.vertex = flat(scene.position)
        self.face = flat(scene.face)
        self.uv = flat(scene.uv)
        self.material = flat(scene.material, UInt32)
        self.emitters(scene)
        self.lights = scene.lights

    def emitters(self, scene):
        """Emissive triangles, drawn by area times the radiance their factor allows."""
        power = np.array([x.emission.mean() * (2 if x.double_sided else 1) for x in scene.materials])[scene.material]
        weight = power * scene.area
        index = np.flatnonzero(weight > 0)
        self.emissive = len(index) > 0
        density = np.zeros(len(weight))  # per square metre
        if self.emissive:
            self.pick = mi.DiscreteDistribution(flat(weight[index]))
            self.emitter = flat(index, UInt32)
            density[index] = power[index] / weight.sum()
        self.density = flat(density)

    def corners(self, triangle, active=True):
        """A triangle's corner and edges."""
        v = [dr.gather(Point3f, self.vertex, 3 * triangle + k, active) for k in range(3)]
        return v[0], v[1] - v[0], v[2] - v[0]

    def coordinates(self, slot, triangle, b, active):
        """Texture coordinates of a slot (0 albedo, 1 emission) at barycentrics."""
        c = [dr.gather(Point2f, self.uv, 6 * triangle + 3 * slot + k, active) for k in range(3)]
        return c[0] * (1 - b.x - b.y) + c[1] * b.x + c[2] * b.y

    def solid(self, triangle, b, active):
        """Is there a surface, or does alpha cut it away?"""
        material = dr.gather(UInt32, self.material, triangle, active)
        cutoff = dr.gather(Float, self.cutoff, material, active)
        _, alpha = self.albedo.eval(material, self.coordinates(0, triangle, b, active & (cutoff > 0)), active & (cutoff > 0))
        return (cutoff == 0) | (alpha >= cutoff)

    @dr.syntax
    def hit(self, ray, active):
        """The closest surface: (valid, triangle, barycentrics)."""
        pi = self.all.ray_intersect_preliminary(ray, coherent=False, active=active)
        triangle, b, valid = UInt32(pi.prim_index), Point2f(pi.prim_uv), pi.is_valid() & active
        if dr.hint(self.masked is not None, mode="scalar"):
            o, d = Point3f(ray.o), Vector3f(ray.d)
            through = valid & ~self.solid(triangle, b, valid)
            while through:
                o = self.behind(o, d, triangle, b, through)
                pi = self.all.ray_intersect_preliminary(Ray3f(o, d), coherent=False, active=through)
                triangle = UInt32(pi.prim_index)
                b = Point2f(pi.prim_uv)
                valid = pi.is_valid()
                through = valid & ~self.solid(triangle, b, valid)
        return valid, triangle, b

    def behind(self, o, d, triangle, b, active):
        """Where a ray goes on after a hit that alpha cut away."""
        v, e1, e2 = self.corners(triangle, active)
        p = v + e1 * b.x + e2 * b.y
        step = OFFSET * 0.1 * (1 + dr.max(dr.abs(p))) / dr.norm(d)
        return Point3f(o + d * (dr.dot(p - o, d) / dr.squared_norm(d) + step))

    @dr.syntax
    def sees(self, o, to, active):
        """Is nothing between two points (already off their surfaces)?"""
        d = to - o
        ray = Ray3f(o, d, 1 - 1e-5, 0, [])
        free = active & ~self.opaque.ray_test(ray, coherent=False, active=active)
        if dr.hint(self.masked is not None, mode="scalar"):
            at, d, t = Point3f(o), Vector3f(d), Float(0)
            looking = Bool(free)
            while looking:
                pi = self.masked.ray_intersect_preliminary(
                    Ray3f(at, d, 1 - 1e-5 - t, 0, []), coherent=False, active=looking
                )
                met = pi.is_valid()
                triangle = dr.gather(UInt32, self.masked_index, pi.prim_index, met)
                blocked = met & self.solid(triangle, pi.prim_uv, met)
                free &= ~blocked
                looking = met & ~blocked
                at = self.behind(at, d, triangle, pi.prim_uv, looking)
                t = dr.dot(at - o, d) / dr.squared_norm(d)
        return free

    @staticmethod
    def off(p, side):
        """A point moved off its surface."""
        return p + side * (OFFSET * (1 + dr.max(dr.abs(p))))

    def punctual(self, k, p, n):
        """Unshadowed irradiance from punctual light k, and a point towards it."""
        light = self.lights[k]
        color = Color3f(*map(float, light.intensity))
        if light.kind == "directional":
            w = -Vector3f(*map(float, light.direction))
            return color * dr.maximum(dr.dot(n, w), 0), p + w * self.reach
        to = Point3f(*map(float, light.position)) - p
        d2 = dr.squared_norm(to)
        w = to * dr.rsqrt(d2)
        e = color * dr.maximum(dr.dot(n, w), 0) / d2
        if light.kind == "spot":
            scale = 1 / max(0.001, float(np.cos(light.inner)) - float(np.cos(light.outer)))
            e *= dr.square(dr.clip((-dr.dot(w, Vector3f(*map(float, light.direction))) - float(np.cos(light.outer))) * scale, 0, 1))
        return e, Point3f(*map(float, light.position))

    def one_punctual(self, p, n, face, u, active):
        """Irradiance from one punctual light, drawn by its unshadowed share."""
        if not self.lights:
            return Color3f(0)
        o = self.off(p, face)
        total, chosen, target, weight = Float(0), Color3f(0), Point3f(o), Float(1)
        for k in range(len(self.lights)):
            e, to = self.punctual(k, p, n)
            share = dr.select(dr.dot(to - p, face) > 0, dr.mean(e), 0)
            total += share
            # Reservoir of one: the random number is rescaled after every draw.
            q = dr.select(total > 0, share / total, 0)
            take = u < q
            u = dr.clip(dr.select(take, u / q, (u - q) / (1 - q)), 0, dr.one_minus_epsilon(Float))
            chosen = dr.select(take, e, chosen)
            weight = dr.select(take, share, weight)
            target = dr.select(take, to, target)
        lit = active & (total > 0)
        lit &= self.sees(o, target, lit)
        return dr.select(lit, chosen * (total / weight), 0)

    def one_emitter(self, p, n, face, u, v, active):
        """Irradiance from a drawn point of the emissive triangles, weighted against cosine sampling."""
        if not self.emissive:
            return Color3f(0)
        i, x, _ = self.pick.sample_reuse_pmf(u, active)
        triangle = dr.gather(UInt32, self.emitter, i, active)
        s = dr.sqrt(1 - x)
        b = Point2f(1 - s, v * s)
        c, e1, e2 = self.corners(triangle, active)
        y = c + e1 * b.x + e2 * b.y
        ny = dr.gather(Vector3f, self.face, triangle, active)
        material = dr.gather(UInt32, self.material, triangle, active)
        to = y - p
        d2 = dr.squared_norm(to)
        w = to * dr.rsqrt(d2)
        cos_y = -dr.dot(ny, w)
        double = dr.gather(UInt32, self.double, material, active) > 0
        ny = dr.select(cos_y < 0, -ny, ny)
        cos_y = dr.select(double, dr.abs(cos_y), cos_y)
        cos_x = dr.dot(n, w)
        lit = active & (cos_x > 0) & (cos_y > 0) & (dr.dot(face, w) > 0) & (d2 > 0)
        lit &= self.solid(triangle, b, lit)
        radiance, _ = self.emission.eval(material, self.coordinates(1, triangle, b, lit), lit)
        density = dr.gather(Float, self.density, triangle, lit) * d2 / cos_y  # per steradian
        lit &= self.sees(self.off(p, face), self.off(y, ny), lit)
        return dr.select(lit, radiance * (cos_x / (density + cos_x * dr.inv_pi)), 0)

    @dr.syntax
    def estimate(self, p, n, face, ray_sample, light_sample, sampler):
        """One sample of irradiance per lane: (from emissive surfaces directly, from bounces). RGB, lux."""
        direct = self.one_emitter(p, n, face, light_sample.x, light_sample.y, Bool(True))
        bounced = Color3f(0)
        cosine = mi.warp.square_to_cosine_hemisphere(ray_sample)
        d = Frame3f(n).to_world(cosine)
        density = cosine.z * dr.inv_pi
        o = self.off(p, face)
        beta = Color3f(dr.pi)
        active = (dr.dot(d, face) > 0) & (cosine.z > 0)
        depth = UInt32(0)
        while active:
            valid, triangle, b = self.hit(Ray3f(o, d), active)
            active &= valid
            c, e1, e2 = self.corners(triangle, active)
            y = c + e1 * b.x + e2 * b.y
            ny = dr.gather(Vector3f, self.face, triangle, active)
            material = dr.gather(UInt32, self.material, triangle, active)
            double = dr.gather(UInt32, self.double, material, active) > 0
            cos_y = -dr.dot(ny, d)
            active &= (cos_y > 0) | (double & (cos_y < 0))
            ny = dr.select(cos_y < 0, -ny, ny)
            cos_y = dr.abs(cos_y)
            if dr.hint(self.emissive, mode="scalar"):
                radiance, _ = self.emission.eval(material, self.coordinates(1, triangle, b, active), active)
                other = dr.gather(Float, self.density, triangle, active) * dr.squared_norm(y - o) / cos_y
                got = dr.select(active, beta * radiance * (density / (density + other)), 0)
                direct += dr.select(depth == 0, got, 0)
                bounced += dr.select(depth == 0, 0, got)
            albedo, _ = self.albedo.eval(material, self.coordinates(0, triangle, b, active), active)
            beta = dr.select(active, beta * albedo, beta)
            e = self.one_punctual(y, ny, ny, sampler.next_1d(active), active)
            e += self.one_emitter(y, ny, ny, sampler.next_1d(active), sampler.next_1d(active), active)
            bounced += dr.select(active, beta * e * dr.inv_pi, 0)
            depth += 1
            keep = dr.select(depth >= ROULETTE, dr.minimum(dr.max(beta) * dr.inv_pi, 0.95), 1)
            active &= (sampler.next_1d(active) < keep) & (depth < DEPTH)
            beta = dr.select(active, beta / keep, beta)
            cosine = mi.warp.square_to_cosine_hemisphere(sampler.next_2d(active))
            density = cosine.z * dr.inv_pi
            active &= density > 0
            d = dr.select(active, Frame3f(ny).to_world(cosine), d)
            o = dr.select(active, self.off(y, ny), o)
        return direct, bounced

    def punctual_direct(self, p, n, face):
        """Irradiance from all punctual lights directly: exact, without noise."""
        p, n, face = (Vector3f(*np.asarray(x, np.float32).T) for x in (p, n, face))
        self.reach = float(dr.norm(self.all.bbox().extents())) * 2 + 1
        total = np.zeros((dr.width(p), 3))
        for k in range(len(self.lights)):
            e, to = self.punctual(k, Point3f(p), n)
            lit = (dr.dot(to - p, face) > 0) & (dr.mean(e) > 0)
            lit &= self.sees(self.off(Point3f(p), face), to, lit)
            total += dr.select(lit, e, 0).numpy().T
        return total

    def round(self, p, n, face, side, seed):
        """A stratified round of side^2 samples a point; means (from emitters directly, from bounces), each [N, 3]."""
        count, per = len(p), side * side
        lane = dr.arange(UInt32, count * per)
        point, stratum = lane // per, lane % per
        p, n, face = (dr.gather(Point3f if x is p else Vector3f, flat(x), point) for x in (p, n, face))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, count * per)
        cell = Point2f(Float(stratum % side), Float(stratum // side))
        ray = (cell + sampler.next_2d()) / side
        # The light's strata are the ray's in another order, so that the two stay unrelated.
        other = (stratum * 7919 + 13) % per if per % 7919 else stratum
        light = (Point2f(Float(other % side), Float(other // side)) + sampler.next_2d()) / side
        direct, bounced = self.estimate(p, n, face, ray, light, sampler)
        out = []
        for x in (direct, bounced):
            out.append(np.stack([dr.block_sum(c + dr.zeros(Float, count * per), per).numpy().astype(float) / per for c in x], 1))
        return out
