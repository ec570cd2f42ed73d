// Homogeneous rasterization (Olano and Greer 1997): a triangle as three edge planes through the origin and one plane of
// the depth value, so that nothing needs clipping. A pixel's ray is d = (s, t, 1).

struct Setup {
    vec3 edge[3]; // inside: dot(edge, d) >= 0 for all three
    vec3 value;   // stored depth value = dot(value, d),
    float most;   // but no more than at the nearest vertex: a sliver's plane is as good as its digits
    vec2 low, high; // bounds of (s, t); valid if bounded
    bool bounded;
    bool empty;
};

// Negating a neighbour's edge exactly keeps shared edges watertight: no fused multiply-adds here.
vec3 edge_plane(vec3 a, vec3 b) {
    precise vec3 plane = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
    return plane;
}

// `f`: the axes of the view's face.
Setup set_up(Triangle triangle, View view, uint face, Face f) {
    vec3 a = triangle.a - view.origin, b = triangle.b - view.origin, c = triangle.c - view.origin;
    a = vec3(dot(f.u, a), dot(f.v, a), dot(f.w, a));
    b = vec3(dot(f.u, b), dot(f.v, b), dot(f.w, b));
    c = vec3(dot(f.u, c), dot(f.v, c), dot(f.w, c));
    // Orthographic: the rays are parallel, and the value interpolated is the scaled depth instead of 1.
    vec3 weight = vec3(1.0);
    if (view.kind == VIEW_ORTHOGRAPHIC) {
        weight = vec3(a.z, b.z, c.z);
        a.z = b.z = c.z = 1.0;
    }
    Setup s;
    s.edge[0] = edge_plane(b, c);
    s.edge[1] = edge_plane(c, a);
    s.edge[2] = edge_plane(a, b);
    precise float determinant = dot(a, s.edge[0]);
    float facing = determinant < 0.0 ? -1.0 : 1.0;
    s.edge[0] *= facing;
    s.edge[1] *= facing;
    s.edge[2] *= facing;
    s.value = (s.edge[0] * weight.x + s.edge[1] * weight.y + s.edge[2] * weight.z) / abs(determinant);
    float floor_t = view.kind == VIEW_HEMICUBE && face != 0 ? 0.0 : -1.0;
    // All three vertices beyond one side of the frustum: nothing to draw.
    vec3 su = vec3(a.x, b.x, c.x), sv = vec3(a.y, b.y, c.y), sw = vec3(a.z, b.z, c.z);
    s.empty = determinant == 0.0 || all(lessThanEqual(sw, vec3(0.0)))
        || all(greaterThan(su, sw)) || all(lessThan(su, -sw)) || all(greaterThan(sv, sw)) || all(lessThan(sv, floor_t * sw));
    s.bounded = all(greaterThan(sw, vec3(1e-6)));
    vec3 nearest = weight / sw;
    s.most = s.bounded ? max(nearest.x, max(nearest.y, nearest.z)) : 1e30;
    vec3 ps = su / sw, pt = sv / sw;
    s.low = vec2(min(ps.x, min(ps.y, ps.z)), min(pt.x, min(pt.y, pt.z)));
    s.high = vec2(max(ps.x, max(ps.y, ps.z)), max(pt.x, max(pt.y, pt.z)));
    return s;
}

// Texture coordinates over a masked triangle: u = dot(u, d) / dot(sum, d). The edge functions are its barycentric
// coordinates but for a factor.
struct CutoutPlanes {
    vec3 u, v, sum;
};

CutoutPlanes cutout_planes(Setup s, Cutout cutout) {
    return CutoutPlanes(s.edge[0] * cutout.uv[0].x + s.edge[1] * cutout.uv[1].x + s.edge[2] * cutout.uv[2].x,
                        s.edge[0] * cutout.uv[0].y + s.edge[1] * cutout.uv[1].y + s.edge[2] * cutout.uv[2].y,
                        s.edge[0] + s.edge[1] + s.edge[2]);
}

uint wrapped(float coordinate, uint size, uint wrap) {
    float period = coordinate - floor(coordinate);
    float mirror = coordinate - 2.0 * floor(0.5 * coordinate);
    float at = wrap == WRAP_REPEAT ? period : wrap == WRAP_MIRROR ? 1.0 - abs(1.0 - mirror) : coordinate;
    // Clamped as integers: no coordinate, not even an undefined one, leads out of the mask.
    return min(uint(clamp(at, 0.0, 1.0) * float(size)), size - 1);
}

bool stops(Uints bits, Cutout cutout, CutoutPlanes planes, vec3 d) {
    vec2 uv = vec2(dot(planes.u, d), dot(planes.v, d)) / dot(planes.sum, d);
    uint x = wrapped(uv.x, cutout.size.x, cutout.wrap & 3);
    uint y = wrapped(uv.y, cutout.size.y, cutout.wrap >> 2);
    uint word = bits.at[cutout.first + y * ((cutout.size.x + 31) / 32) + x / 32];
    return (word >> (x & 31) & 1) != 0;
}

// A plane at d = (s, t, 1). Both passes round it alike, so that it does not matter which one draws a triangle.
float at(vec3 plane, float s, float t) {
    precise float value = plane.x * s + plane.y * t + plane.z;
    return value;
}

float depth_at(Setup setup, float s, float t) {
    return min(at(setup.value, s, t), setup.most);
}

bool inside(Setup setup, float s, float t) {
    return min(at(setup.edge[0], s, t), min(at(setup.edge[1], s, t), at(setup.edge[2], s, t))) >= 0.0;
}

// Centres of pixels.
float column_center(uint i, uint size) { return (float(i) + 0.5) * (2.0 / float(size)) - 1.0; }
float row_center(uint j, uint size, bool side) { return (float(j) + 0.5) * (2.0 / float(size)) - (side ? 0.0 : 1.0); }
