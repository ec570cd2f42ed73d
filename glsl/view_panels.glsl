// Vertices of the panels, as egui has them.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

struct PanelVertex {
    vec2 position; // points, from the top left corner
    vec2 uv;
    uint color;    // encoded, alpha multiplied in
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer PanelVertices { PanelVertex at[]; };

layout(push_constant, scalar) uniform Push {
    PanelVertices vertices;
    vec2 scale; // to clip space
};
