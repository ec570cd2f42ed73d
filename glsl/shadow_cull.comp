#version 460
// Which chunk of triangles of the listed groups can be seen in which face of which view: appends (chunk, view and face). Chunks
// whose triangles cover many pixels are drawn first; of the others those that lie behind what was drawn are left out.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "view.glsl"
#include "faces.glsl"
#include "hidden.glsl"

// A workgroup takes a group.
layout(local_size_x_id = 3) in;

// Draws everything; what is drawn first; the rest, unless it is hidden; what one of a light's versions has alone, likewise.
const uint ALL = 0, FIRST = 1, REST = 2, OWN = 3;
layout(constant_id = 0) const uint WHICH = ALL;
// Pixels that a triangle covers on average if its chunk is drawn first. Many small triangles hide little for their cost.
layout(constant_id = 1) const float PIXELS = 16.0;
// Views have limits.
layout(constant_id = 2) const bool LIMITED = false;

layout(push_constant, scalar) uniform Push {
    Chunks chunks;
    Groups groups;
    Views views;
    Pairs from;
    ListHeads from_head;
    Pairs list;
    ListHeads head;
};

// Chunks an invocation, at most 6: they share the reading of the view.
const uint EACH = GROUP / gl_WorkGroupSize.x;

// Whether a chunk is to hide others: it is near, or its triangles are large.
bool is_first(View view, vec3 offset, vec3 extent, uint count) {
    float reach = 0.5 * float(view.size) * length(extent);
    return reach * reach >= PIXELS * float(count) * dot(offset, offset);
}

void main() {
    if (list_index() >= from_head.at[0].entries) return;
    uvec2 entry = from.at[list_index()];
    uint index = entry.y & 63, level = entry.y >> 6;
    View view = views.at[index];
    bool hemicube = view.kind == VIEW_HEMICUBE;
    uint start = groups.at[entry.x].first[level], count = groups.at[entry.x].count[level];
    uint open = LIMITED ? open_faces(views, index) : 31;
    // Bits for the faces of all chunks.
    uint seen = 0;
    uint k = 0;
    for (uint at = gl_LocalInvocationIndex;;) {
        if (at < count) {
            uint chunk = start + at;
            vec3 offset = chunks.at[chunk].center - view.origin;
            vec3 extent = chunks.at[chunk].extent;
            bool asked = true;
            if (WHICH == FIRST) asked = hemicube && is_first(view, offset, extent, chunks.at[chunk].count);
            if (WHICH == REST) asked = !(hemicube && is_first(view, offset, extent, chunks.at[chunk].count));
            seen |= asked ? (faces_of(view, offset, extent) & open) << FACES * k : 0;
        }
        at += gl_WorkGroupSize.x;
        if (++k == EACH || at >= count) break;
    }
    // What takes longer to find out, for those that are left.
    if (LIMITED || WHICH == REST || WHICH == OWN) {
        for (uint left = hemicube || LIMITED ? seen : 0; left != 0; left &= left - 1) {
            uint bit = uint(findLSB(left));
            uint chunk = start + gl_LocalInvocationIndex + bit / FACES * gl_WorkGroupSize.x, face = bit % FACES;
            Framed box = framed(face_axes(face, view.x, view.y, view.z), chunks.at[chunk].center - view.origin, chunks.at[chunk].extent);
            uint asked = LIMITED ? views.at[index].asked[face] : EVERYTHING;
            bool out_of_it = LIMITED && unasked(view, face, asked, box);
            if (WHICH == REST || WHICH == OWN) out_of_it = out_of_it || hemicube && covered(Uints(view.depth), view.size, face, asked, box.center, box.half_size, 1.0001, false);
            seen &= out_of_it ? ~(1u << bit) : ~0u;
        }
    }
    uint weight = 0;
    uint slot = atomicAdd(head.at[0].entries, bitCount(seen));
    for (uint left = seen; left != 0; left &= left - 1) {
        uint bit = uint(findLSB(left));
        uint chunk = start + gl_LocalInvocationIndex + bit / FACES * gl_WorkGroupSize.x;
        list.at[slot++] = uvec2(chunk, index * 8 + bit % FACES);
        weight += chunks.at[chunk].count;
    }
    atomicAdd(head.at[0].weight, weight);
}
