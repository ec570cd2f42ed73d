//! The options, in clap's words.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Parser, Subcommand};

use super::options;
use super::values::{count, numbers, positive};

/// Bakes lightmaps from glTF scenes by many-light global illumination.
#[derive(Parser)]
#[command(version, about, max_term_width = 110)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub device: options::Device,
    /// Worker threads; the result does not depend on them
    #[arg(long, global = true)]
    pub threads: Option<NonZeroUsize>,
    /// Write results, progress and errors as JSON, one object a line
    #[arg(long, global = true)]
    pub json: bool,
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more; twice for everything
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

#[derive(Subcommand)]
pub enum Command {
    /// Bake a scene's lightmaps
    Bake(Box<Bake>),
    /// Bake a scene, play a script of edits, and write the bake of the edited scene
    Replay(Box<Replay>),
    /// Measure bakes, sweeps and edits: tables, JSON, and ratios to earlier figures
    Bench(Box<crate::bench::Bench>),
    /// Compare two lightmaps or two bakes
    Compare(Compare),
    /// List the Vulkan devices and what each lacks
    Devices,
    /// Write a built-in scene as glTF
    Scene(Scene),
}

#[derive(clap::Args)]
pub struct Bake {
    #[command(flatten)]
    pub scene: options::Scene,
    /// Folder for scene.glb, lightmap_K.exr, bake.json and preview.png
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Texels per metre, the same everywhere
    #[arg(long, value_name = "TEXELS/M", value_parser = positive, conflicts_with = "texels")]
    pub density: Option<f32>,
    /// Width and height of a lightmap page [default: as large as needed, up to 4096]
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(16..=16384))]
    pub page_size: Option<u32>,
    /// Cells that stand for the light, or `auto`: refine until the estimated error meets the preset's [default: auto]
    #[arg(long, value_name = "N|auto", value_parser = clusters)]
    pub clusters: Option<Clusters>,
    /// Light paths in all (100k, 1M)
    #[arg(long, value_name = "N", value_parser = count)]
    pub paths: Option<u64>,
    /// Most bounces of a path [default: 16, where nearly no light is left]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=32))]
    pub bounces: Option<u32>,
    /// Pixels along the edge of an indirect light's shadow map
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(8..=1024))]
    pub shadow_size: Option<u32>,
    /// Chooses the random sequences
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Leave direct light out of the lightmap
    #[arg(long)]
    pub indirect_only: bool,
    /// Stop refining in time to end after this long (30s, 2m, 500ms)
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub budget: Option<Duration>,
    /// Repeat a bake: the bake.json of the folder whose scene.glb is given as the scene
    #[arg(long, value_name = "BAKE.JSON", conflicts_with_all = ["quality", "density", "texels", "page_size", "clusters",
        "paths", "bounces", "shadow_size", "seed", "indirect_only", "budget"])]
    pub settings: Option<PathBuf>,
    /// Afterwards subtract every second light, add it again, and fail unless every bit is as before
    #[arg(long)]
    pub verify: bool,
}

#[derive(clap::Args)]
pub struct Replay {
    #[command(flatten)]
    pub bake: Bake,
    #[command(flatten)]
    pub edits: options::Edits,
    /// The script: JSON, an edit a line
    pub script: PathBuf,
    /// Write so many lightmaps along the way, evenly over the time
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub snapshots: u32,
    /// Milliseconds of updates between two looks at the map, as a viewer's frame has them [default: as long as a line waits; 33 with --snapshots]
    #[arg(long, value_name = "MS", value_parser = positive)]
    pub frame_ms: Option<f32>,
    /// Share of invalid flux at which balancing may have half of the work
    #[arg(long, value_name = "SHARE", value_parser = share, default_value_t = 0.1)]
    pub turns_at: f64,
    /// What tells which lights an edit made wrong, and so the order of updates: the light that falls on the bounds of what it
    /// changed, or the paths that it changed alone
    #[arg(long, value_enum, default_value = "bounds")]
    pub priority: Priority,
    /// Where the viewport's error is seen from, and what is seen from there put right first: position and target in metres [default: the file's first camera]
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = numbers::<6>, allow_hyphen_values = true)]
    pub camera: Option<[f32; 6]>,
    /// Bake the edited scene again from nothing, to plot how fast that would have come to the same map, and compare every bit
    #[arg(long)]
    pub rebake: bool,
    /// Go on with the next line after one that is refused
    #[arg(long)]
    pub keep_going: bool,
}

#[derive(Clone, Copy)]
pub enum Clusters {
    Auto,
    Count(u32),
}

#[derive(clap::Args)]
pub struct Compare {
    /// A lightmap (.exr) or a bake's folder
    pub a: PathBuf,
    /// The other, taken as the reference
    pub b: PathBuf,
    /// Write the differences in false colours, one PNG a page
    #[arg(short, long, value_name = "PNG")]
    pub output: Option<PathBuf>,
}

#[derive(clap::Args)]
pub struct Scene {
    /// cornell, integrating-sphere, furnace, museum, town-square or warehouse
    pub name: String,
    /// A .gltf or .glb file
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub enum Priority {
    Bounds,
    Paths,
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        Err("must be above 0 and below 1".into())
    }
}

fn clusters(text: &str) -> Result<Clusters, String> {
    if text == "auto" {
        return Ok(Clusters::Auto);
    }
    let n = count(text)?;
    u32::try_from(n)
        .map(Clusters::Count)
        .map_err(|_| "is too many".into())
}

fn duration(text: &str) -> Result<Duration, String> {
    let bad = || "write a time like 30s, 2m or 500ms".to_owned();
    let (digits, factor) = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("h", 3600.0)]
        .into_iter()
        .find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, factor)))
        .ok_or_else(bad)?;
    let seconds = digits.parse::<f64>().map_err(|_| bad())? * factor;
    if seconds.is_nan() || seconds <= 0.0 {
        return Err("must be above 0".into());
    }
    Duration::try_from_secs_f64(seconds).map_err(|_| "is too long".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        use clap::CommandFactory as _;
        Args::command().debug_assert();
    }

    #[test]
    fn times_read_as_people_write_them() {
        assert_eq!(duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("2m"), Ok(Duration::from_secs(120)));
        assert!(duration("30").is_err() && duration("-1s").is_err() && duration("1e40h").is_err());
    }
}
