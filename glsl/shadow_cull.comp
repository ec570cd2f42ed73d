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
bool is_first(uint view, vec3 offset, vec3 extent, uint count) {
    float reach = 0.5 * float(views.at[view].size) * length(extent);
    return reach * reach >= PIXELS * float(count) * dot(offset, offset);
}

// Whether everything in a box lies behind what is seen in each of the pixels that it can touch.
bool hidden(uint view, uint face, Face f, vec3 offset, vec3 extent) {
    vec3 center = vec3(dot(f.u, offset), dot(f.v, offset), dot(f.w, offset));
    vec3 half_size = vec3(dot(abs(f.u), extent), dot(abs(f.v), extent), dot(abs(f.w), extent));
    return covered(blocks, view, face, center, half_size, 1.0001, false);
}

// Whether a box around `offset` from the view's origin touches what the view is limited to.
bool matters(uint view, vec3 offset, vec3 extent) {
    // Loaded as one: see the driver's trap with parts of a vec4.
    vec4 limit = views.at[view].limit;
    if (views.at[view].kind == VIEW_ORTHOGRAPHIC) {
        vec3 x = views.at[view].x, y = views.at[view].y;
        return abs(dot(x, offset) - limit.x) <= dot(abs(x), extent) + limit.z
            && abs(dot(y, offset) - limit.y) <= dot(abs(y), extent) + limit.w;
    }
    float distance = length(offset);
    float radius = length(extent);
    if (limit.w > PI || distance <= radius) return true;
    float angle = acos(clamp(dot(limit.xyz, offset) / distance, -1.0, 1.0));
    return angle <= limit.w + asin(radius / distance) + 1e-3;
}

void main() {
    uint chunk = gl_GlobalInvocationID.x;
    uint view = gl_GlobalInvocationID.y;
    if (chunk >= chunk_count) return;
    Instance instance = instances.at[chunks.at[chunk].instance];
    if (!stands(instance, views.at[view].version)) return;
    bool in_both = stands(instance, views.at[view].other);
    if (WHICH == OWN ? in_both : !in_both || views.at[view].borrows != 0) return;
    vec3 offset = chunks.at[chunk].center - views.at[view].origin;
    vec3 extent = chunks.at[chunk].extent;
    if (!matters(view, offset, extent)) return;
    vec3 x = views.at[view].x;
    vec3 y = views.at[view].y;
    vec3 z = views.at[view].z;
    bool hemicube = views.at[view].kind == VIEW_HEMICUBE;
    bool first = (WHICH == FIRST || WHICH == REST) && hemicube && is_first(view, offset, extent, chunks.at[chunk].count);
    if (WHICH == FIRST && !first || WHICH == REST && first) return;
    uint faces = hemicube ? 5 : 1;
    for (uint face = 0; face < faces; ++face) {
        Face f = face_axes(face, x, y, z);
        bool seen;
        if (hemicube) {
            // The box lies wholly beyond one of the planes u = w, u = -w, v = w, v = -w (side faces: v = 0).
            vec3 n0 = f.w - f.u, n1 = f.w + f.u, n2 = f.w - f.v, n3 = face == 0 ? f.w + f.v : f.v;
            seen = dot(n0, offset) + dot(abs(n0), extent) > 0.0 && dot(n1, offset) + dot(abs(n1), extent) > 0.0
                && dot(n2, offset) + dot(abs(n2), extent) > 0.0 && dot(n3, offset) + dot(abs(n3), extent) > 0.0;
        } else {
            seen = abs(dot(x, offset)) - dot(abs(x), extent) < 1.0 && abs(dot(y, offset)) - dot(abs(y), extent) < 1.0;
        }
        if (WHICH == REST && hemicube) seen = seen && !hidden(view, face, f, offset, extent);
        if (!seen) continue;
        list.at[atomicAdd(head.at[0].entries, 1)] = uvec2(chunk, view * 8 + face);
        atomicAdd(head.at[0].weight, chunks.at[chunk].count);
    }
}
