#version 460
// Triangles that are a point in uv space claim what is left of the texels that bilinear filtering there can fetch.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "uv_raster.glsl"

layout(local_size_x = 64) in;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= count) return;
    uint triangle = strips.at[index].primitive;
    uint rows = strips.at[index].rows;
    ivec2 a = triangles.at[triangle].corner[0];
    uint value = triangles.at[triangle].id + CLAIM_VERTEX;
    int low_x = max(first_texel(a.x - REACH + 1), unpack(triangles.at[triangle].low).x);
    int high_x = min(last_texel(a.x + REACH - 1), unpack(triangles.at[triangle].high).x - 1);
    int last_y = unpack(rows).y;
    for (int y = unpack(rows).x; y <= last_y; ++y) {
        for (int x = low_x; x <= high_x; ++x) claim(x, y, value);
    }
}
