#version 460
// Surfaces of the scene.
#extension GL_GOOGLE_include_directive : require
#include "view_scene.glsl"
#include "view_mesh.glsl"

layout(location = 0) out vec3 position;
layout(location = 1) out vec3 normal;
layout(location = 2) out vec2 color_uv;
layout(location = 3) out vec2 emission_uv;
// Texels beside a triangle belong to other surfaces: where a pixel's centre lies beside it, the uv must not.
layout(location = 4) centroid out vec2 light_uv;

void main() {
    Vertex v = vertices.at[gl_VertexIndex];
    Placed o = placed.at[object];
    position = o.position + o.x * v.position.x + o.y * v.position.y + o.z * v.position.z;
    // The inverse transpose up to a factor; a mirrored object's fronts stay fronts.
    vec3 yz = cross(o.y, o.z);
    normal = (yz * v.normal.x + cross(o.z, o.x) * v.normal.y + cross(o.x, o.y) * v.normal.z) * sign(dot(o.x, yz));
    color_uv = v.color_uv;
    emission_uv = v.emission_uv;
    light_uv = (v.light_uv + o.origin) / picture.it.page_size;
    gl_Position = picture.it.clip * vec4(position, 1.0);
}
