//! The scene: what is lit and what lights it, in glTF's units (metres, candela, lux, cd/m², Y up).

mod accessor;
mod assets;
pub mod builtin;
mod copier;
mod document;
pub mod edit;

mod error;
mod json;
mod lights;
mod load;
mod materials;
mod meshes;
mod nodes;
mod pack;
mod sample;
mod source;
mod uri;

use std::sync::Arc;

pub use document::{Document, EncodedImage, ImageData};
pub use error::SceneError;
pub use lights::overlay_lights;
pub use pack::write_whole;
pub use sample::Bounds;
pub use source::Source;

use glam::{Affine2, Affine3A, Vec2, Vec3, Vec4};

/// Everything a bake reads. Objects, meshes, materials and lights refer to each other by index.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Triangle meshes in object space, shared by the objects that instance them.
    pub meshes: Vec<Arc<Mesh>>,
    /// Materials; index 0 is glTF's default material.
    pub materials: Vec<Material>,
    /// Decoded images.
    pub textures: Vec<Arc<Texture>>,
    /// One object per node that has a mesh, in the nodes' order. While a scene is edited, also one for every node whose
    /// mesh is not shown (see [`Scene::is_gone`]), so that an object's index is for life.
    pub objects: Vec<Object>,
    /// Punctual lights and emissive objects, in the order of [`Light::id`].
    pub lights: Vec<Light>,
    /// Cameras of the file, in world space.
    pub cameras: Vec<Camera>,
}

/// An instance of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The node's name, or `node N`.
    pub name: String,
    /// The glTF node it came from.
    pub node: u32,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Object space to world space. May mirror (negative determinant): the front side then stays the one that
    /// glTF defines, so world-space triangles are wound the other way round.
    pub transform: Affine3A,
}

/// Triangles in object space: all primitives of one glTF mesh, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The mesh's name, or `mesh N`.
    pub name: String,
    /// Index of the glTF mesh it came from.
    pub source: u32,
    /// Vertex positions, metres. Vertices that no triangle uses are where a used one is.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, one per position; zero where the file gives none (the geometric one is used there).
    pub normals: Vec<Vec3>,
    /// Texture coordinate sets 0 and 1, one per position, or empty.
    pub texcoords: [Vec<Vec2>; 2],
    /// Counter-clockwise seen from the front. Degenerate triangles are kept, so that indices stay the file's.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles and vertices, one per glTF primitive, in order.
    pub primitives: Vec<Primitive>,
}

/// A glTF primitive inside a [`Mesh`].
#[derive(Clone, Debug, PartialEq)]
pub struct Primitive {
    /// Its triangles.
    pub triangles: std::ops::Range<u32>,
    /// Its vertices.
    pub vertices: std::ops::Range<u32>,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Index of the glTF primitive inside its mesh.
    pub source: u32,
}

/// A diffuse material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The material's name, or `material N`.
    pub name: String,
    /// Index of the glTF material; none for the default material.
    pub source: Option<u32>,
    /// Linear base colour factor and alpha.
    pub base_color: Vec4,
    /// Multiplies `base_color`.
    pub base_color_texture: Option<TextureRef>,
    /// Emitted radiance in cd/m² (factor times strength), linear RGB.
    pub emission: Vec3,
    /// Multiplies `emission`.
    pub emission_texture: Option<TextureRef>,
    /// Reflects and emits from both sides.
    pub double_sided: bool,
    /// How alpha is read.
    pub alpha: AlphaMode,
}

/// How a material's alpha is read. `BLEND` is loaded as `Mask { cutoff: 0.5 }`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Where alpha is below the cutoff, light passes.
    Mask {
        /// Between 0 and 1.
        cutoff: f32,
    },
}

/// A texture as a material uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: u32,
    /// Texture coordinate set, 0 or 1.
    pub texcoord: u32,
    /// `KHR_texture_transform`, applied to the coordinates first.
    pub transform: Affine2,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
}

/// Sampler wrapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Clamp to edge.
    Clamp,
    /// Repeat.
    Repeat,
    /// Mirrored repeat.
    Mirror,
}

/// An image: sRGB-encoded colour, linear alpha, top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `width * height` texels.
    pub texels: Vec<[u8; 4]>,
}

/// A light source: an aperture that light leaves, an emission profile, an intensity and a transform (IBGI section 3.2).
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// The node's name, or `node N`.
    pub name: String,
    /// The glTF node it came from.
    pub node: u32,
    /// Where the light leaves.
    pub aperture: Aperture,
    /// Linear RGB times intensity: candela for points and spots, lux for directional lights; unused for an
    /// emissive object, whose radiance is its materials'.
    pub intensity: Vec3,
    /// Light space to world space, without scale: the light aims along its -Z.
    pub transform: Affine3A,
}

impl Light {
    /// Names the light in every version of its scene, whatever is added or removed around it: twice its node's index,
    /// plus 1 for an emissive object.
    pub fn id(&self) -> u32 {
        2 * self.node + u32::from(matches!(self.aperture, Aperture::Surface { .. }))
    }
}

/// Where a light's light leaves, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aperture {
    /// A point that shines equally everywhere.
    Point,
    /// A point that shines into a cone, with the falloff that `KHR_lights_punctual` suggests. Half angles, radians.
    Spot {
        /// Full intensity inside.
        inner: f32,
        /// Dark outside.
        outer: f32,
    },
    /// Parallel light from infinitely far.
    Directional,
    /// The emissive triangles of an object (index into [`Scene::objects`]), Lambertian.
    Surface {
        /// Index into [`Scene::objects`].
        object: u32,
    },
}

impl Scene {
    /// One object of loose triangles (world space, metres) of the default material, without light.
    pub fn of_triangles(triangles: &[[Vec3; 3]]) -> Self {
        let count = triangles.len() as u32;
        let mesh = Mesh {
            positions: triangles.as_flattened().to_vec(),
            normals: vec![Vec3::ZERO; 3 * triangles.len()],
            triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            primitives: vec![Primitive {
                triangles: 0..count,
                vertices: 0..3 * count,
                material: 0,
                source: 0,
            }],
            ..Mesh::default()
        };
        Self {
            meshes: vec![mesh.into()],
            materials: vec![Material::default()],
            objects: vec![Object {
                name: "triangles".into(),
                node: 0,
                mesh: 0,
                transform: Affine3A::IDENTITY,
            }],
            ..Self::default()
        }
    }
}

/// A perspective camera that looks along its -Z.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The node's name, or `node N`.
    pub name: String,
    /// Camera space to world space.
    pub transform: Affine3A,
    /// Vertical field of view, radians.
    pub fov_y: f32,
}
