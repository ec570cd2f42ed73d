// Push constants of the scene's surfaces.
layout(push_constant, scalar) uniform Push {
    PictureAt picture;
    Vertices vertices;
    PlacedAt placed;
    Surfaces surfaces;
    uint object;
    uint surface;
};
