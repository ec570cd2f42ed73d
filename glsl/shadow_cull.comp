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
// Chunks an invocation, at most 6: they share the reading of the view.
layout(constant_id = 2) const uint EACH = 1;
// Views have limits.
layout(constant_id = 3) const bool LIMITED = false;

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

// On which sides of the plane through the origin some of a box lies: in front, behind.
bvec2 sides(vec3 plane, vec3 offset, vec3 extent) {
    float at = dot(plane, offset), reach = dot(abs(plane), extent);
    return bvec2(at + reach > 0.0, reach - at > 0.0);
}

// A bit for each face that a box can be seen in.
uint faces_of(View view, vec3 offset, vec3 extent) {
    if (view.kind == VIEW_ORTHOGRAPHIC)
        return abs(dot(view.x, offset)) - dot(abs(view.x), extent) < 1.0 && abs(dot(view.y, offset)) - dot(abs(view.y), extent) < 1.0 ? 1 : 0;
    // Faces meet in these planes; what lies wholly beyond one of a face's is not in it. Side faces end at the horizon.
    bvec2 zx = sides(view.z - view.x, offset, extent), xz = sides(view.z + view.x, offset, extent);
    bvec2 zy = sides(view.z - view.y, offset, extent), yz = sides(view.z + view.y, offset, extent);
    bvec2 yx = sides(view.x - view.y, offset, extent), xy = sides(view.x + view.y, offset, extent);
    bool above = sides(view.z, offset, extent).x;
    return (zx.x && xz.x && zy.x && yz.x ? 1 : 0) | (above && zx.y && yx.x && xy.x ? 2 : 0) | (above && xz.y && yx.y && xy.y ? 4 : 0)
        | (above && zy.y && yx.y && xy.x ? 8 : 0) | (above && yz.y && yx.x && xy.y ? 16 : 0);
}

// Whether a box in a face's axes lies beyond a side of a rectangle of (s, t).
bool beside(vec4 r, vec3 center, vec3 half_size) {
    vec4 way = vec4(r.xy * center.z - center.xy, center.xy - r.zw * center.z);
    vec4 reach = half_size.xyxy + abs(r) * half_size.z;
    return any(greaterThan(way, reach));
}

void main() {
    uint first = gl_WorkGroupID.x * gl_WorkGroupSize.x * EACH + gl_LocalInvocationIndex;
    uint index = gl_GlobalInvocationID.y;
    View view = views.at[index];
    bool hemicube = view.kind == VIEW_HEMICUBE;
    // Faces of which anything is asked.
    uint open = 31;
    if (LIMITED)
        [[unroll]] for (uint face = 0; face < FACES; ++face) {
            uint asked = views.at[index].asked[face];
            open &= (asked & 255) > (asked >> 16 & 255) ? ~(1u << face) : ~0u;
        }
    // Bits for the faces of all chunks.
    uint seen = 0;
    uint k = 0;
    for (;;) {
        uint chunk = first + k * gl_WorkGroupSize.x;
        if (chunk < chunk_count) {
            Instance instance = instances.at[chunks.at[chunk].instance];
            bool in_both = stands(instance, view.other);
            bool asked = stands(instance, view.version) && (WHICH == OWN ? !in_both : in_both && view.borrows == 0);
            vec3 offset = chunks.at[chunk].center - view.origin;
            vec3 extent = chunks.at[chunk].extent;
            if (WHICH == FIRST) asked = asked && hemicube && is_first(view, offset, extent, chunks.at[chunk].count);
            if (WHICH == REST) asked = asked && !(hemicube && is_first(view, offset, extent, chunks.at[chunk].count));
            seen |= asked ? (faces_of(view, offset, extent) & open) << FACES * k : 0;
        }
        if (++k == EACH) break;
    }
    // What takes longer to find out, for those that are left.
    if (LIMITED || WHICH == REST) {
        for (uint left = hemicube || LIMITED ? seen : 0; left != 0; left &= left - 1) {
            uint bit = uint(findLSB(left));
            uint chunk = first + bit / FACES * gl_WorkGroupSize.x, face = bit % FACES;
            vec3 offset = chunks.at[chunk].center - view.origin;
            vec3 extent = chunks.at[chunk].extent;
            Face f = face_axes(face, view.x, view.y, view.z);
            vec3 center = vec3(dot(f.u, offset), dot(f.v, offset), dot(f.w, offset));
            vec3 half_size = vec3(dot(abs(f.u), extent), dot(abs(f.v), extent), dot(abs(f.w), extent));
            // Rays of an orthographic map are parallel.
            float at = hemicube ? center.z : 1.0, deep = hemicube ? half_size.z : 0.0;
            uint asked = LIMITED ? views.at[index].asked[face] : EVERYTHING;
            bool out_of_it = LIMITED && beside(rectangle(asked, hemicube && face != 0), vec3(center.xy, at), vec3(half_size.xy, deep));
            if (WHICH == REST) out_of_it = out_of_it || hemicube && covered(blocks, index, face, asked, center, half_size, 1.0001, false);
            seen &= out_of_it ? ~(1u << bit) : ~0u;
        }
    }
    uint weight = 0;
    uint slot = atomicAdd(head.at[0].entries, bitCount(seen));
    for (uint left = seen; left != 0; left &= left - 1) {
        uint bit = uint(findLSB(left));
        uint chunk = first + bit / FACES * gl_WorkGroupSize.x;
        list.at[slot++] = uvec2(chunk, index * 8 + bit % FACES);
        weight += chunks.at[chunk].count;
    }
    atomicAdd(head.at[0].weight, weight);
}
