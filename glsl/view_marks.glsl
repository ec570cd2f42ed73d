// Marks that lie over the picture: lines and points as wide as they are in pixels, and filled shapes. Colours are encoded as the
// screen is, alpha multiplied in.
#extension GL_GOOGLE_include_directive : require
#include "view_scene.glsl"

struct Stroke {
    vec3 from;   // world; a point is a stroke that ends where it begins
    vec3 to;
    uint color;
    float width; // pixels
};

struct Corner {
    vec3 position; // world; three are a triangle
    uint color;
};

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Strokes { Stroke at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Corners { Corner at[]; };

layout(push_constant, scalar) uniform Push {
    PictureAt picture;
    Strokes strokes;
    Corners corners;
    vec2 size; // of the picture, pixels
};

// Marks lie on surfaces: a little nearer to the eye, they show.
const float NEARER = 1.002;
