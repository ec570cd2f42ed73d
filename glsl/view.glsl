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

// Rows of pixels of a face, and where it starts.
uint face_height(uint face, uint size) {
    return face == 0 ? size : size / 2;
}

uint face_offset(uint face, uint size) {
    return face == 0 ? 0 : size * size + (face - 1) * (size * size / 2);
}
