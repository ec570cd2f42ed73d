//! What is baked: a scene's file, and the lights that are added to it.

use std::path::PathBuf;

use glam::Vec3;

use super::{Document, Scene, SceneError, overlay_lights};

/// A scene's file with what is added to it, each time that it is loaded.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// The scene.
    pub path: PathBuf,
    /// Files whose lights are laid over it.
    pub lights: Vec<PathBuf>,
    /// Degrees above the horizon, degrees from -Z towards +X, lux.
    pub suns: Vec<[f32; 3]>,
    /// Position in metres, candela.
    pub points: Vec<[f32; 4]>,
}

impl Source {
    /// Reads it all.
    ///
    /// # Errors
    /// A file that cannot be read, or a scene that cannot be baked.
    pub fn load(&self) -> Result<(Scene, Document), SceneError> {
        let (mut scene, mut document) = Scene::load(&self.path)?;
        for file in &self.lights {
            overlay_lights(&mut scene, &mut document, file)?;
        }
        for &[elevation, azimuth, lux] in &self.suns {
            scene.add_sun(&mut document, elevation, azimuth, lux, Vec3::ONE)?;
        }
        for &[x, y, z, candela] in &self.points {
            scene.add_point(&mut document, Vec3::new(x, y, z), candela, Vec3::ONE)?;
        }
        scene.validate()?;
        Ok((scene, document))
    }
}
