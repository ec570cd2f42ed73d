#version 460
// Triangles in uv space claim the texels whose centre they cover, border included. An invocation is a strip of one.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "uv_raster.glsl"

layout(local_size_x = 64) in;

// Widens low..high by where the edge crosses the row through v.
void cross_row(ivec2 a, ivec2 b, int v, inout float low, inout float high) {
    if (v < min(a.y, b.y) || v > max(a.y, b.y)) return;
    float from = float(a.x);
    float to = float(b.x);
    if (a.y != b.y) {
        from += float(v - a.y) * (float(b.x - a.x) / float(b.y - a.y));
        to = from;
    }
    low = min(low, min(from, to));
    high = max(high, max(from, to));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= count) return;
    uint triangle = strips.at[index].primitive;
    uint rows = strips.at[index].rows;
    ivec2 a = triangles.at[triangle].corner[0];
    ivec2 b = triangles.at[triangle].corner[1];
    ivec2 c = triangles.at[triangle].corner[2];
    uint id = triangles.at[triangle].id;
    int low_x = max(first_texel(min(a.x, min(b.x, c.x))), unpack(triangles.at[triangle].low).x);
    int high_x = min(last_texel(max(a.x, max(b.x, c.x))), unpack(triangles.at[triangle].high).x - 1);
    int64_t area = cross_product(b - a, c - a);
    if (area == 0) return;
    if (area < 0) {
        ivec2 swapped = b;
        b = c;
        c = swapped;
    }
    int last_y = unpack(rows).y;
    for (int y = unpack(rows).x; y <= last_y; ++y) {
        int v = centre(y);
        float low = 1e30;
        float high = -1e30;
        cross_row(a, b, v, low, high);
        cross_row(b, c, v, low, high);
        cross_row(c, a, v, low, high);
        if (low > high) continue;
        int x = max(first_texel(int(low) - GUESS), low_x);
        int last_x = min(last_texel(int(high) + GUESS), high_x);
        ivec2 p = ivec2(centre(x), v);
        int64_t ab = cross_product(b - a, p - a);
        int64_t bc = cross_product(c - b, p - b);
        int64_t ca = cross_product(a - c, p - c);
        int64_t ab_step = int64_t(b.y - a.y) * UNIT;
        int64_t bc_step = int64_t(c.y - b.y) * UNIT;
        int64_t ca_step = int64_t(a.y - c.y) * UNIT;
        for (; x <= last_x; ++x) {
            if ((ab | bc | ca) >= 0) claim(x, y, id);
            ab -= ab_step;
            bc -= bc_step;
            ca -= ca_step;
        }
    }
}
