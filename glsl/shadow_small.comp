#version 460
// Draws the triangles of listed chunks into their faces, an invocation one or several triangles: those that touch few pixels
// at once, the others go on a list for shadow_large.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"
#include "raster.glsl"

// A workgroup takes a chunk.
layout(local_size_x_id = 2) in;

// Pixels of the bounding rectangle up to which a triangle is drawn here.
layout(constant_id = 0) const uint SMALL = 32;
// The triangles have cutouts.
layout(constant_id = 1) const bool MASKED = false;
// Views have limits.
layout(constant_id = 3) const bool LIMITED = false;

layout(push_constant, scalar) uniform Push {
    Chunks chunks;
    Pairs list;
    ListHeads head;
    // From here on as in shadow_large.comp.
    Triangles triangles;
    Views views;
    Pairs large;
    ListHeads large_head;
    Cutouts cutouts;
    Uints bits;
    uint large_capacity;
};

// `whose`: view and face, as the lists have them; `asked`: of the face's pixels.
void draw(uint triangle, uint whose, View view, uint face, Face axes, Span asked) {
    Setup s = set_up(triangles.at[triangle], view, face, axes);
    bool side = view.kind == VIEW_HEMICUBE && face != 0;
    // Unbounded: all that is asked for. Clamped as integers, so that nothing leads out of the face.
    Span span = pixels_between(vec4(s.low, s.high), view.size, side);
    vec2 low = s.bounded ? max(span.first, asked.first) : asked.first;
    vec2 high = s.bounded ? min(span.last, asked.last) : asked.last;
    bool visible = !s.empty && low.x <= high.x && low.y <= high.y;
    if (!visible) return;
    uvec2 last = uvec2(view.size, side ? view.size / 2 : view.size) - 1;
    uvec2 first_pixel = min(uvec2(low), last);
    uvec2 last_pixel = min(uvec2(high), last);
    uint columns = last_pixel.x - first_pixel.x + 1;
    uint rows = last_pixel.y - first_pixel.y + 1;
    bool here = columns * rows <= SMALL;
    if (!here) {
        uint parts = (rows + LARGE_ROWS - 1) / LARGE_ROWS;
        uint slot = atomicAdd(large_head.at[0].entries, parts);
        if (slot <= large_capacity && large_capacity - slot >= parts)
            for (uint part = 0; part < parts; ++part) large.at[slot + part] = uvec2(triangle, whose | part << 9);
        else {
            // No room for all of them: what was taken is left empty.
            for (uint part = slot; part < min(slot + parts, large_capacity); ++part) large.at[part] = uvec2(triangle, whose | 0xfffffe00u);
            here = true;
        }
    }
    if (!here) return;

    Cutout cutout;
    CutoutPlanes planes;
    if (MASKED) {
        cutout = cutouts.at[triangle];
        planes = cutout_planes(s, cutout);
    }
    Uints depth = Uints(view.depth);
    uint base = face_offset(face, view.size);
    uint row = base + first_pixel.y * view.size + first_pixel.x;
    uint column = 0, line = 0;
    // One loop, not two: on SIMD processors the longest row of eight triangles would cost all of them its length.
    for (uint pixel = columns * rows;;) {
        float x = column_center(first_pixel.x + column, view.size);
        float y = row_center(first_pixel.y + line, view.size, side);
        float value = depth_at(s, x, y);
        if (inside(s, x, y) && value > 0.0 && (!MASKED || stops(bits, cutout, planes, vec3(x, y, 1.0))))
            atomicMax(depth.at[row + column], floatBitsToUint(value));
        if (--pixel == 0) break;
        ++column;
        bool wrap = column == columns;
        column = wrap ? 0 : column;
        line += wrap ? 1 : 0;
        row += wrap ? view.size : 0;
    }
}

void main() {
    // Lists are dispatched as whole rows: what lies past the end is of earlier batches.
    uint index = list_index();
    if (index >= head.at[0].entries) return;
    uvec2 entry = list.at[index];
    uint face = entry.y & 7;
    View view = views.at[entry.y >> 3];
    Face axes = face_axes(face, view.x, view.y, view.z);
    uint count = chunks.at[entry.x].count;
    uint rectangle = LIMITED ? views.at[entry.y >> 3].asked[face] : EVERYTHING;
    Span asked = asked_pixels(rectangle, view.size, view.kind == VIEW_HEMICUBE && face != 0);
    uint i = gl_LocalInvocationIndex;
    for (;;) {
        if (i < count) draw(entry.x * CHUNK + i, entry.y, view, face, axes, asked);
        i += gl_WorkGroupSize.x;
        if (i >= count) break;
    }
}
