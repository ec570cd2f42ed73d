#version 460
// Object-space texels become world-space receivers of an instance, and every tile gets its box and normal cone. A
// workgroup is a tile.
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"

layout(local_size_x = 64) in;

// Rows of the affine transform, and of the cofactor matrix that carries normals (mirroring included).
struct Placement {
    vec4 row[3];
    vec3 normal_row[3];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Placements { Placement at[]; };

layout(push_constant, scalar) uniform Push {
    Texels texels;
    Clearances clearances;
    Placements placements;
    Receivers receivers;
    Tiles tiles;
    uint first_texels;   // tile of texels, and of sums
    uint first_receivers; // tile of receivers
    uint instance;       // NONE: the objects' first ones, of the same index
    uint replacing;      // not 0: the tiles are those of the list instead
    ReplacedTiles replaced;
};

shared vec3 positions[TILE];
shared vec3 normals[TILE];
shared vec3 faces[TILE];
shared float pushes[TILE];

void main() {
    uint sums = first_texels + gl_WorkGroupID.x;
    uint tile = first_receivers + gl_WorkGroupID.x;
    uint lane = gl_LocalInvocationIndex;
    uint whose = instance;
    if (replacing != 0) {
        Replaced entry = replaced.at[gl_WorkGroupID.x];
        sums = entry.tile;
        tile = entry.new;
        whose = entry.instance;
        if (lane == 0) tiles.at[entry.old].instance = entry.ended;
    }
    uint slot = tile * TILE + lane;
    Texel texel = texels.at[sums * TILE + lane];
    uint place = whose == NONE ? texel.object : whose;
    vec4 p = vec4(texel.position, 1.0);
    vec3 n = texel.normal;
    vec3 f = texel.face;
    vec4 r0 = placements.at[place].row[0];
    vec4 r1 = placements.at[place].row[1];
    vec4 r2 = placements.at[place].row[2];
    vec3 position = vec3(dot(r0, p), dot(r1, p), dot(r2, p));
    vec3 normal = vec3(dot(placements.at[place].normal_row[0], n),
                       dot(placements.at[place].normal_row[1], n),
                       dot(placements.at[place].normal_row[2], n));
    normal *= inversesqrt(max(dot(normal, normal), 1e-30));
    vec3 face = vec3(dot(placements.at[place].normal_row[0], f),
                     dot(placements.at[place].normal_row[1], f),
                     dot(placements.at[place].normal_row[2], f));
    face *= inversesqrt(max(dot(face, face), 1e-30));
    receivers.at[slot].position = position;
    receivers.at[slot].normal = normal;
    receivers.at[slot].face = face;
    receivers.at[slot].clearance = clearances.at[sums * TILE + lane];
    positions[lane] = position;
    normals[lane] = normal;
    faces[lane] = face;
    Clearance clearance = clearances.at[sums * TILE + lane];
    pushes[lane] = length(clearance.push) * clearance.way;
    barrier();
    if (lane != 0) return;

    vec3 low = positions[0];
    vec3 high = positions[0];
    vec3 sum = vec3(0.0);
    for (uint i = 0; i < TILE; ++i) {
        low = min(low, positions[i]);
        high = max(high, positions[i]);
        sum += normals[i];
    }
    float length_squared = dot(sum, sum);
    vec3 axis = length_squared > 1e-12 ? sum * inversesqrt(length_squared) : vec3(0.0, 0.0, 1.0);
    float cone_cos = 1.0, face_cos = 1.0, aside = 0.0, thickness = 0.0;
    vec3 center = 0.5 * (low + high);
    for (uint i = 0; i < TILE; ++i) {
        cone_cos = min(cone_cos, dot(axis, normals[i]));
        face_cos = min(face_cos, dot(axis, faces[i]));
        aside = max(aside, pushes[i]);
        thickness = max(thickness, abs(dot(axis, positions[i] - center)));
    }
    tiles.at[tile].center = center;
    // Rounding must not let a receiver out of its own box.
    tiles.at[tile].extent = 0.5 * (high - low) + 1e-6 * (abs(low) + abs(high));
    tiles.at[tile].thickness = thickness + 1e-6 * dot(abs(low) + abs(high), vec3(1.0));
    tiles.at[tile].aside = aside;
    tiles.at[tile].sums = sums;
    tiles.at[tile].instance = place;
    tiles.at[tile].axis = axis;
    tiles.at[tile].cone_cos = cone_cos > 0.01 && length_squared > 1e-12 ? cone_cos - 1e-5 : -1.0;
    tiles.at[tile].face_cos = face_cos > 0.01 && length_squared > 1e-12 ? face_cos - 1e-5 : -1.0;
}
