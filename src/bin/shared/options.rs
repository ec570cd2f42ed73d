//! Options that both programs have, in clap's words: the device, and the scene that is baked.

use std::path::PathBuf;

use rebake::bake::{KEPT_MAPS, Quality};
use rebake::gpu::GpuOptions;
use rebake::scene::Source;

use super::values::{count, numbers};

/// The device, and what it is watched with.
#[derive(clap::Args)]
pub struct Device {
    /// Vulkan device: its index or a part of its name, as `rebake devices` lists them
    #[arg(
        long = "device",
        id = "device",
        global = true,
        value_name = "INDEX|NAME"
    )]
    name: Option<String>,
    /// Run the Vulkan validation layer; any message is an error
    #[arg(long, global = true)]
    validate: bool,
    /// Write where the time went: spans of all threads and passes of the device, for ui.perfetto.dev or chrome://tracing
    #[arg(long, global = true, value_name = "JSON")]
    pub trace: Option<PathBuf>,
}

/// What edits may use besides.
#[derive(clap::Args)]
pub struct Edits {
    /// Device memory in which depth maps are kept, so that edits need not draw them again, MiB; 0: none are
    #[arg(long, value_name = "MIB", default_value_t = KEPT_MAPS >> 20, value_parser = clap::value_parser!(u64).range(..=1 << 20))]
    kept_maps: u64,
}

impl Edits {
    /// Bytes, as the library has them.
    pub fn kept_maps(&self) -> u64 {
        self.kept_maps << 20
    }
}

impl Device {
    /// As the library has them.
    pub fn options(&self) -> GpuOptions {
        GpuOptions {
            device: self.name.clone(),
            validate: self.validate,
        }
    }
}

/// A scene with the lights that are added to it, and how well it is baked.
#[derive(clap::Args)]
pub struct Scene {
    /// A .gltf or .glb file
    #[arg(id = "scene", value_name = "SCENE")]
    pub path: PathBuf,
    /// Preset: how much time to trade for how little error [default: preview]
    #[arg(long, value_enum)]
    pub quality: Option<Quality>,
    /// Texels that the scene's surface should cover (1M, 256k, 512x512), more of them where light varies [default: 1M, but at most 100 texels/m]
    #[arg(long, value_name = "N", value_parser = count)]
    pub texels: Option<u64>,
    /// Add a sun: degrees above the horizon, degrees from -Z towards +X, lux
    #[arg(long, value_name = "ELEVATION,AZIMUTH,LUX", value_parser = numbers::<3>, allow_hyphen_values = true)]
    sun: Vec<[f32; 3]>,
    /// Add a point light: position in metres, candela
    #[arg(long, value_name = "X,Y,Z,CANDELA", value_parser = numbers::<4>, allow_hyphen_values = true)]
    point: Vec<[f32; 4]>,
    /// Lay the lights of another glTF file over the scene
    #[arg(long, value_name = "FILE")]
    lights: Vec<PathBuf>,
}

impl Scene {
    /// The file with its lights.
    pub fn source(&self) -> Source {
        Source {
            path: self.path.clone(),
            lights: self.lights.clone(),
            suns: self.sun.clone(),
            points: self.point.clone(),
        }
    }
}
