// What the passes in uv space share: triangles on an integer grid, strips of them as work, and claims.
// 64-bit integers make every decision exact, and floats only narrow down where to look.

struct UvTriangle {
    ivec2 corner[3]; // UV_UNIT steps per texel of the page
    uint id;         // over all objects
    uint low, high;  // first texel of its object's rectangle and the one after its last: x | y << 16
};

// Rows of a primitive: at most a few thousand texels to look at, because lavapipe ends loops after 65,535 rounds.
struct UvStrip {
    uint primitive;
    uint rows; // first | last << 16
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer UvTriangles { UvTriangle at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer UvStrips { UvStrip at[]; };

layout(push_constant, scalar) uniform Push {
    UvTriangles triangles;
    UvStrips strips;
    Uints claims; // one a texel of the page
    uint count;   // strips
    uint page_size;
};

const int UNIT = int(UV_UNIT);
const int REACH = int(UV_REACH);
// More than float arithmetic on coordinates of up to 2^27 can be off by, in steps.
const int GUESS = UNIT / 16;

ivec2 unpack(uint packed) {
    return ivec2(packed & 0xffffu, packed >> 16);
}

// First texel whose centre lies at or after v.
int first_texel(int v) {
    return (v + UNIT / 2 - 1) >> findMSB(UV_UNIT);
}

// Last texel whose centre lies at or before v.
int last_texel(int v) {
    return (v - UNIT / 2) >> findMSB(UV_UNIT);
}

int centre(int texel) {
    return texel * UNIT + UNIT / 2;
}

int64_t cross_product(ivec2 a, ivec2 b) {
    return int64_t(a.x) * int64_t(b.y) - int64_t(a.y) * int64_t(b.x);
}

// The lowest claim wins, whatever the order: triangles before edges before vertices, then by triangle.
void claim(int x, int y, uint value) {
    uint index = uint(y) * page_size + uint(x);
    if (claims.at[index] > value) atomicMin(claims.at[index], value);
}
