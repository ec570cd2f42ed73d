#version 460
// Edges in uv space claim what triangles have left of the texels that bilinear filtering on them can fetch: those whose
// centre is less than REACH away along u and along v. The texels that an edge crosses go before those that it only
// passes: then a texel between small triangles goes to one that is near. An invocation is a strip of one edge; an edge
// of no length, which has no direction to test against, is left to the vertices.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "uv_raster.glsl"

layout(local_size_x = 64) in;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= count) return;
    uint primitive = strips.at[index].primitive;
    uint rows = strips.at[index].rows;
    uint triangle = primitive / 3;
    uint k = primitive % 3;
    ivec2 a = triangles.at[triangle].corner[k];
    ivec2 b = triangles.at[triangle].corner[k == 2 ? 0 : k + 1];
    uint id = triangles.at[triangle].id;
    int low_x = max(first_texel(min(a.x, b.x) - REACH + 1), unpack(triangles.at[triangle].low).x);
    int high_x = min(last_texel(max(a.x, b.x) + REACH - 1), unpack(triangles.at[triangle].high).x - 1);
    ivec2 d = b - a;
    // The box around a centre, as wide as it lies across the edge.
    int64_t span = int64_t(abs(d.x) + abs(d.y));
    int64_t reach = int64_t(REACH) * span;
    int64_t half_reach = int64_t(UNIT / 2) * span;
    ivec2 low = min(a, b) - UNIT / 2;
    ivec2 high = max(a, b) + UNIT / 2;
    float slope = d.y == 0 ? 0.0 : float(d.x) / float(d.y);
    int last_y = unpack(rows).y;
    for (int y = unpack(rows).x; y <= last_y; ++y) {
        int v = centre(y);
        float from = float(a.x);
        float to = float(b.x);
        if (d.y != 0) {
            // The part of the edge that this row's boxes can touch.
            to = from + float(min(max(a.y, b.y), v + REACH) - a.y) * slope;
            from += float(max(min(a.y, b.y), v - REACH) - a.y) * slope;
        }
        int x = max(first_texel(int(min(from, to)) - REACH - GUESS), low_x);
        int last_x = min(last_texel(int(max(from, to)) + REACH + GUESS), high_x);
        int64_t across = cross_product(d, ivec2(centre(x), v) - a);
        int64_t across_step = int64_t(d.y) * UNIT;
        for (; x <= last_x; ++x) {
            if (abs(across) < reach) {
                bool crosses = abs(across) < half_reach && centre(x) > low.x && centre(x) < high.x && v > low.y && v < high.y;
                claim(x, y, id + (crosses ? CLAIM_EDGE : CLAIM_FAR_EDGE));
            }
            across -= across_step;
        }
    }
}
