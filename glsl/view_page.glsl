// Push constants of a page of the lightmap.
layout(push_constant, scalar) uniform Push {
    PictureAt picture;
};
