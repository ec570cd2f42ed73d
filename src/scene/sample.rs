//! What a point of a surface looks like: its material, albedo, emission and alpha.

use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use super::{AlphaMode, Material, Mesh, Scene, Texture, TextureRef, Wrap};

/// An axis-aligned box in world space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The smallest coordinates; positive infinity where the box is empty.
    pub min: Vec3,
    /// The largest coordinates; negative infinity where the box is empty.
    pub max: Vec3,
}

impl Bounds {
    /// Contains nothing.
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The smallest box that holds this one and the point.
    pub fn with(self, point: Vec3) -> Self {
        Self {
            min: self.min.min(point),
            max: self.max.max(point),
        }
    }

    /// The smallest box that holds both.
    pub fn union(self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Its middle.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Its edge lengths; zero if it is empty.
    pub fn size(&self) -> Vec3 {
        (self.max - self.min).max(Vec3::ZERO)
    }
}

impl Scene {
    /// The mesh of an object.
    pub fn mesh(&self, object: u32) -> &Mesh {
        &self.meshes[self.objects[object as usize].mesh as usize]
    }

    /// Whether an object is not part of the scene (any more): its node was removed, or shows nothing. Its mesh is then empty.
    pub fn is_gone(&self, object: u32) -> bool {
        self.mesh(object).triangles.is_empty()
    }

    /// Whether an object is anywhere in the scene; there may be no such object yet.
    pub fn stands(&self, object: u32) -> bool {
        (object as usize) < self.objects.len() && !self.is_gone(object)
    }

    /// The material of an object's triangle.
    pub fn material(&self, object: u32, triangle: u32) -> &Material {
        &self.materials[self.mesh(object).primitive_of(triangle).material as usize]
    }

    /// Whether an object's transform mirrors, so that its world-space triangles are wound the other way round.
    pub fn mirrored(&self, object: u32) -> bool {
        self.objects[object as usize]
            .transform
            .matrix3
            .determinant()
            < 0.0
    }

    /// A triangle's corners in world space, counter-clockwise seen from its front: for a mirrored object the last two
    /// are swapped against the mesh's order.
    pub fn world_triangle(&self, object: u32, triangle: u32) -> [Vec3; 3] {
        let mesh = self.mesh(object);
        let transform = self.objects[object as usize].transform;
        let [a, b, c] = mesh.triangles[triangle as usize]
            .map(|v| transform.transform_point3(mesh.positions[v as usize]));
        if self.mirrored(object) {
            [a, c, b]
        } else {
            [a, b, c]
        }
    }

    /// The box around all surfaces.
    pub fn bounds(&self) -> Bounds {
        (0..self.objects.len() as u32).fold(Bounds::EMPTY, |bounds, object| {
            bounds.union(&self.object_bounds(object))
        })
    }

    /// The box around an object's vertices in world space; empty for one that is gone.
    pub fn object_bounds(&self, object: u32) -> Bounds {
        let transform = self.objects[object as usize].transform;
        let positions = &self.mesh(object).positions;
        positions.iter().fold(Bounds::EMPTY, |bounds, p| {
            bounds.with(transform.transform_point3(*p))
        })
    }

    /// m² of all triangles of all objects, one side each.
    pub fn surface_area(&self) -> f64 {
        let area = |object: u32| -> f64 {
            (0..self.mesh(object).triangles.len() as u32)
                .map(|t| self.world_triangle(object, t))
                .map(|[a, b, c]| 0.5 * f64::from((b - a).cross(c - a).length()))
                .sum()
        };
        (0..self.objects.len() as u32).map(area).sum()
    }

    /// Diffuse albedo, linear RGB in 0..1, at barycentric coordinates: the weights of the triangle's
    /// corners in the mesh's order, for mirrored objects too.
    pub fn albedo(&self, object: u32, triangle: u32, barycentric: Vec3) -> Vec3 {
        let material = self.material(object, triangle);
        let texel = self.fetch(&material.base_color_texture, object, triangle, barycentric);
        (material.base_color * texel)
            .truncate()
            .clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Emitted radiance in cd/m², linear RGB, at barycentric coordinates (as for [`Self::albedo`]).
    pub fn emission(&self, object: u32, triangle: u32, barycentric: Vec3) -> Vec3 {
        let material = self.material(object, triangle);
        if material.emission == Vec3::ZERO {
            return Vec3::ZERO;
        }
        material.emission
            * self
                .fetch(&material.emission_texture, object, triangle, barycentric)
                .truncate()
    }

    /// Whether light passes the surface at barycentric coordinates (as for [`Self::albedo`]): its alpha is below the cutoff.
    pub fn alpha_passes(&self, object: u32, triangle: u32, barycentric: Vec3) -> bool {
        let material = self.material(object, triangle);
        match material.alpha {
            AlphaMode::Opaque => false,
            AlphaMode::Mask { cutoff } => {
                material.base_color.w
                    * self
                        .fetch(&material.base_color_texture, object, triangle, barycentric)
                        .w
                    < cutoff
            }
        }
    }

    /// Colour and alpha of a texture at a point of a triangle; white without texture.
    fn fetch(
        &self,
        reference: &Option<TextureRef>,
        object: u32,
        triangle: u32,
        barycentric: Vec3,
    ) -> Vec4 {
        let Some(reference) = reference else {
            return Vec4::ONE;
        };
        let mesh = self.mesh(object);
        let set = &mesh.texcoords[reference.texcoord as usize];
        let [a, b, c] = mesh.triangles[triangle as usize]
            .map(|v| set.get(v as usize).copied().unwrap_or(Vec2::ZERO));
        reference.sample(
            &self.textures[reference.texture as usize],
            a * barycentric.x + b * barycentric.y + c * barycentric.z,
        )
    }
}

impl TextureRef {
    /// The texture at coordinates of a mesh: transformed, wrapped, bilinear in linear colour.
    pub fn sample(&self, texture: &Texture, uv: Vec2) -> Vec4 {
        texture.sample(self.transform.transform_point2(uv), self.wrap)
    }
}

impl Texture {
    /// Linear RGB and alpha, bilinear between texel centres; (0, 0) is the top left corner of the image.
    pub fn sample(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        if self.texels.is_empty() || !uv.is_finite() {
            return Vec4::ONE;
        }
        let (x0, x1, fx) = taps(uv.x, self.width, wrap[0]);
        let (y0, y1, fy) = taps(uv.y, self.height, wrap[1]);
        let texel = |x: u32, y: u32| {
            let [r, g, b, a] = self.texels[y as usize * self.width as usize + x as usize];
            let linear = &*LINEAR;
            Vec4::new(
                linear[usize::from(r)],
                linear[usize::from(g)],
                linear[usize::from(b)],
                f32::from(a) / 255.0,
            )
        };
        texel(x0, y0)
            .lerp(texel(x1, y0), fx)
            .lerp(texel(x0, y1).lerp(texel(x1, y1), fx), fy)
    }
}

/// The two texels around a coordinate and the weight of the second.
fn taps(coordinate: f32, size: u32, wrap: Wrap) -> (u32, u32, f32) {
    // Wrapped first, in double precision, so that far coordinates keep their fraction.
    let period = match wrap {
        Wrap::Repeat => f64::from(coordinate).rem_euclid(1.0),
        Wrap::Mirror => f64::from(coordinate).rem_euclid(2.0),
        Wrap::Clamp => f64::from(coordinate).clamp(0.0, 1.0),
    };
    let at = period * f64::from(size) - 0.5;
    let low = at.floor();
    let size = i64::from(size);
    let texel = |i: i64| match wrap {
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::Clamp => i.clamp(0, size - 1),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * size);
            if i < size { i } else { 2 * size - 1 - i }
        }
    } as u32;
    (texel(low as i64), texel(low as i64 + 1), (at - low) as f32)
}

/// sRGB to linear (IEC 61966-2-1) for all bytes.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        let s = byte as f64 / 255.0;
        (if s <= 0.040_45 {
            s / 12.92
        } else {
            ((s + 0.055) / 1.055).powf(2.4)
        }) as f32
    })
});
