#version 460
// Draws LARGE_ROWS rows of one listed triangle a workgroup: every invocation takes rows, and solves each for its span of pixels.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"
#include "raster.glsl"

// For lists alone: a plain dispatch would count with the default.
layout(local_size_x = 8, local_size_x_id = 1) in;

layout(constant_id = 0) const bool MASKED = false;
// Views have limits.
layout(constant_id = 2) const bool LIMITED = false;

layout(push_constant, scalar) uniform Push {
    Triangles triangles;
    Views views;
    Pairs large;
    ListHeads large_head;
    Cutouts cutouts;
    Uints bits;
    uint large_capacity;
};

void main() {
    uint index = list_index();
    if (index >= min(large_head.at[0].entries, large_capacity)) return;
    uvec2 entry = large.at[index];
    uint face = entry.y & 7;
    View view = views.at[entry.y >> 3 & 63];
    Setup s = set_up(triangles.at[entry.x], view, face, face_axes(face, view.x, view.y, view.z));
    bool side = view.kind == VIEW_HEMICUBE && face != 0;
    float half_size = 0.5 * float(view.size);
    Uints depth = Uints(view.depth);
    uint base = face_offset(face, view.size);

    // Parts are counted from the first row that is asked for.
    uint rectangle = LIMITED ? views.at[entry.y >> 3 & 63].asked[face] : EVERYTHING;
    Span asked = asked_pixels(rectangle, view.size, side);
    Span span = pixels_between(vec4(s.low, s.high), view.size, side);
    float first = s.bounded ? max(span.first.y, asked.first.y) : asked.first.y;
    float last = s.bounded ? min(span.last.y, asked.last.y) : asked.last.y;
    first += float((entry.y >> 9) * LARGE_ROWS);
    last = min(last, first + float(LARGE_ROWS - 1));
    Cutout cutout;
    CutoutPlanes planes;
    if (MASKED) {
        cutout = cutouts.at[entry.x];
        planes = cutout_planes(s, cutout);
    }
    for (float j = first + float(gl_LocalInvocationIndex); j <= last; j += float(gl_WorkGroupSize.x)) {
        float t = row_center(uint(j), view.size, side);
        float low = -1.0, high = 1.0;
        [[unroll]] for (uint k = 0; k < 3; ++k) {
            float slope = s.edge[k].x;
            float rest = s.edge[k].y * t + s.edge[k].z;
            float bound = -rest / slope;
            low = slope > 0.0 ? max(low, bound) : low;
            high = slope < 0.0 ? min(high, bound) : high;
            if (slope == 0.0 && rest < 0.0) high = -2.0;
        }
        // A tenth of a pixel wider than the edges say: each pixel is tested. Clamped before and after the conversion: an
        // edge almost along the row has its bound at infinity.
        int i0 = max(int(ceil((min(low, 2.0) + 1.0) * half_size - 0.6)), int(asked.first.x));
        int i1 = min(int(floor((max(high, -2.0) + 1.0) * half_size - 0.4)), int(asked.last.x));
        uint row = base + uint(j) * view.size;
        for (int i = i0; i <= i1; ++i) {
            float x = column_center(uint(i), view.size);
            float value = depth_at(s, x, t);
            if (inside(s, x, t) && value > 0.0 && (!MASKED || stops(bits, cutout, planes, vec3(x, t, 1.0))))
                atomicMax(depth.at[row + uint(i)], floatBitsToUint(value));
        }
    }
}
