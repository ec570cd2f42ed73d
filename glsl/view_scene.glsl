// What the viewer's shaders share. Their Rust twins are layout-tested.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require

const float PI = 3.14159265358979;
const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

// All that is the same for a whole picture.
struct Picture {
    mat4 clip;       // world to clip space; nearer is greater
    vec3 eye;        // world
    float exposure;  // display units per cd/m²
    float lux;       // lux per unit of the lightmap's image
    float page_size; // texels
    vec2 scale;      // what both ends of a false-colour scale stand for
    float page;      // that is looked at
    float least;     // errors are relative to no less than this, units of the lightmap's image
};

struct Vertex {
    vec3 position; // object space
    vec3 normal;
    vec2 color_uv;
    vec2 emission_uv;
    vec2 light_uv; // texels, relative to the object's rectangle
};

struct Placed {
    vec3 x, y, z;  // columns of object to world
    vec3 position;
    vec2 origin;   // of the object's rectangle, texels
    float page;
};

struct Surface {
    vec3 color;
    float alpha;
    vec3 emission; // cd/m²
    float cutoff;  // of alpha; 0: opaque
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer PictureAt { Picture it; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Vertices { Vertex at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer PlacedAt { Placed at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Surfaces { Surface at[]; };
