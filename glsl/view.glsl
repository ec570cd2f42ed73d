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

// All of a face.
const uint EVERYTHING = 0xffff0000u;

// What is asked of a face (View.asked), in its (s, t); low, then high.
vec4 rectangle(uint asked, bool side) {
    vec4 cells = vec4(asked & 255, asked >> 8 & 255, (asked >> 16 & 255) + 1, (asked >> 24) + 1);
    vec4 all = cells / 128.0 - 1.0;
    return side ? vec4(all.x, cells.y / 256.0, all.z, cells.w / 256.0) : all;
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

// Pixels of a face that are asked for (View.asked).
Span asked_pixels(uint asked, uint size, bool side) {
    uvec2 all = uvec2(size, side ? size / 2 : size);
    uvec2 first = uvec2(asked & 255, asked >> 8 & 255) * all >> 8;
    uvec2 end = (uvec2((asked >> 16 & 255) + 1, (asked >> 24) + 1) * all + 255) >> 8;
    return Span(vec2(first), vec2(end) - 1.0);
}

// Where a hemicube's blocks begin, behind its pixels: rows of the top face, then of the side faces.
uint first_block(uint size) {
    return 3 * size * size;
}

// Rows of pixels of a face, and where it starts.
uint face_height(uint face, uint size) {
    return face == 0 ? size : size / 2;
}

uint face_offset(uint face, uint size) {
    return face == 0 ? 0 : size * size + (face - 1) * (size * size / 2);
}
