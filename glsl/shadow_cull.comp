#version 460
// Which chunk of triangles can be seen in which face of which view: appends (chunk, view and face). Chunks whose triangles
// cover many pixels are drawn first; of the others those that lie behind what was drawn are left out.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"
#include "hidden.glsl"

layout(local_size_x = 64) in;

// Draws everything; what is drawn first; the rest, unless it is hidden; what one of a light's two versions has alone.
const uint ALL = 0, FIRST = 1, REST = 2, OWN = 3;
layout(constant_id = 0) const uint WHICH = ALL;
// Pixels that a triangle covers on average if its chunk is drawn first. Many small triangles hide little for their cost.
layout(constant_id = 1) const float PIXELS = 16.0;
// Chunks an invocation: they share the reading of the view.
layout(constant_id = 2) const uint EACH = 1;

layout(push_constant, scalar) uniform Push {
    Chunks chunks;
    Instances instances;
    Views views;
    Pairs list;
    ListHeads head;
    Floats blocks; // of depth_blocks, after what is drawn first
    uint chunk_count;
};

// Whether a chunk is to hide others: it is near, or its triangles are large.
bool is_first(View view, vec3 offset, vec3 extent, uint count) {
    float reach = 0.5 * float(view.size) * length(extent);
    return reach * reach >= PIXELS * float(count) * dot(offset, offset);
}

// Whether everything in a box lies behind what is seen in each of the pixels that it can touch.
bool hidden(uint view, uint face, Face f, vec3 offset, vec3 extent) {
    vec3 center = vec3(dot(f.u, offset), dot(f.v, offset), dot(f.w, offset));
    vec3 half_size = vec3(dot(abs(f.u), extent), dot(abs(f.v), extent), dot(abs(f.w), extent));
    return covered(blocks, view, face, center, half_size, 1.0001, false);
}

// Whether a box around `offset` from the view's origin touches what the view is limited to.
bool matters(View view, vec3 offset, vec3 extent) {
    vec4 limit = view.limit;
    if (view.kind == VIEW_ORTHOGRAPHIC)
        return abs(dot(view.x, offset) - limit.x) <= dot(abs(view.x), extent) + limit.z
            && abs(dot(view.y, offset) - limit.y) <= dot(abs(view.y), extent) + limit.w;
    float distance = length(offset);
    float radius = length(extent);
    if (limit.w > PI || distance <= radius) return true;
    float angle = acos(clamp(dot(limit.xyz, offset) / distance, -1.0, 1.0));
    return angle <= limit.w + asin(radius / distance) + 1e-3;
}

void cull(uint chunk, uint index, View view) {
    Instance instance = instances.at[chunks.at[chunk].instance];
    if (!stands(instance, view.version)) return;
    bool in_both = stands(instance, view.other);
    if (WHICH == OWN ? in_both : !in_both || view.borrows != 0) return;
    vec3 offset = chunks.at[chunk].center - view.origin;
    vec3 extent = chunks.at[chunk].extent;
    if (!matters(view, offset, extent)) return;
    bool hemicube = view.kind == VIEW_HEMICUBE;
    bool first = (WHICH == FIRST || WHICH == REST) && hemicube && is_first(view, offset, extent, chunks.at[chunk].count);
    if (WHICH == FIRST && !first || WHICH == REST && first) return;
    uint faces = hemicube ? 5 : 1;
    for (uint face = 0; face < faces; ++face) {
        Face f = face_axes(face, view.x, view.y, view.z);
        bool seen;
        if (hemicube) {
            // The box lies wholly beyond one of the planes u = w, u = -w, v = w, v = -w (side faces: v = 0).
            vec3 n0 = f.w - f.u, n1 = f.w + f.u, n2 = f.w - f.v, n3 = face == 0 ? f.w + f.v : f.v;
            seen = dot(n0, offset) + dot(abs(n0), extent) > 0.0 && dot(n1, offset) + dot(abs(n1), extent) > 0.0
                && dot(n2, offset) + dot(abs(n2), extent) > 0.0 && dot(n3, offset) + dot(abs(n3), extent) > 0.0;
        } else {
            seen = abs(dot(view.x, offset)) - dot(abs(view.x), extent) < 1.0 && abs(dot(view.y, offset)) - dot(abs(view.y), extent) < 1.0;
        }
        if (WHICH == REST && hemicube) seen = seen && !hidden(index, face, f, offset, extent);
        if (!seen) continue;
        list.at[atomicAdd(head.at[0].entries, 1)] = uvec2(chunk, index * 8 + face);
        atomicAdd(head.at[0].weight, chunks.at[chunk].count);
    }
}

void main() {
    uint first = gl_WorkGroupID.x * gl_WorkGroupSize.x * EACH + gl_LocalInvocationIndex;
    uint index = gl_GlobalInvocationID.y;
    View view = views.at[index];
    uint k = 0;
    for (;;) {
        uint chunk = first + k * gl_WorkGroupSize.x;
        if (chunk < chunk_count) cull(chunk, index, view);
        if (++k == EACH) break;
    }
}
