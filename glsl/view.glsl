// How directions meet the pixels of a view (hemicube: Cohen and Greenberg 1985). Inverse depth 1/z, larger is nearer,
// 0 is nothing: it is linear over a face, and positive floats order as their bits do, so atomicMax keeps the nearest.

struct Face {
    vec3 u, v, w;
};

// Axes of a face; w looks through it. Side faces see v in 0..w alone.
Face face_axes(uint face, vec3 x, vec3 y, vec3 z) {
    if (face == 0) return Face(x, y, z);
    if (face == 1) return Face(y, z, x);
    if (face == 2) return Face(y, z, -x);
    if (face == 3) return Face(x, z, y);
    return Face(x, z, -y);
}

// What of a face a limited view asks for: the rectangle around its cone, or its own, in the face's (s, t); low, then high.
vec4 scissor(View view, uint face) {
    vec4 limit = view.limit;
    if (view.kind == VIEW_ORTHOGRAPHIC) return vec4(limit.xy - limit.zw, limit.xy + limit.zw);
    vec4 all = vec4(-1.0, -1.0, 1.0, 1.0);
    if (limit.w > 1.5) return all;
    Face f = face_axes(face, view.x, view.y, view.z);
    vec3 axis = vec3(dot(f.u, limit.xyz), dot(f.v, limit.xyz), dot(f.w, limit.xyz));
    float sine = sin(limit.w);
    float depth = axis.z * axis.z - sine * sine;
    // The cone reaches behind the face's plane.
    if (axis.z <= sine || depth < 1e-4) return all;
    vec2 middle = axis.xy * axis.z / depth;
    vec2 reach = sine * sqrt(axis.xy * axis.xy + depth) / depth;
    vec2 slack = 1e-3 * (1.0 + abs(middle) + reach);
    return vec4(middle - reach - slack, middle + reach + slack);
}

// Pixels of a face, from the first to the last whose centres lie between two points in (s, t); those may be others than the
// face has. Both passes round them alike.
struct Span {
    vec2 first, last;
};

Span pixels_between(vec4 rectangle, uint size, bool side) {
    vec2 origin = vec2(1.0, side ? 0.0 : 1.0);
    precise vec2 low = (rectangle.xy + origin) * (0.5 * float(size)) - 0.5;
    precise vec2 high = (rectangle.zw + origin) * (0.5 * float(size)) - 0.5;
    return Span(ceil(low), floor(high));
}

// Pixels of a face that a view asks for.
Span asked_pixels(View view, uint face, bool side, bool limited) {
    vec2 last = vec2(view.size, side ? view.size / 2 : view.size) - 1.0;
    Span all = Span(vec2(0.0), last);
    if (!limited) return all;
    Span asked = pixels_between(scissor(view, face), view.size, side);
    return Span(max(asked.first, all.first), min(asked.last, all.last));
}

// Rows of pixels of a face, and where it starts.
uint face_height(uint face, uint size) {
    return face == 0 ? size : size / 2;
}

uint face_offset(uint face, uint size) {
    return face == 0 ? 0 : size * size + (face - 1) * (size * size / 2);
}
