//! The options, in clap's words.

use std::path::PathBuf;
use std::time::Duration;

use clap::Parser;

use super::options;
use super::values::positive;

/// Shows a glTF scene in the light of its lightmap, while that is baked and follows edits.
#[derive(Parser)]
#[command(name = "viewer", version, about, max_term_width = 110)]
pub struct Args {
    #[command(flatten)]
    pub scene: options::Scene,
    #[command(flatten)]
    pub edits: options::Edits,
    #[command(flatten)]
    pub device: options::Device,
    /// Milliseconds of work on the map between two pictures [default: 16, or half of what a picture takes, where that is more]
    #[arg(long, value_name = "MS", value_parser = positive)]
    pub frame_ms: Option<f32>,
    /// Width and height of pictures
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x720", value_parser = size)]
    pub size: Size,
    /// Folder that saved bakes, scenes, scripts and screenshots go to [default: the current one]
    #[arg(short, long, value_name = "DIR", conflicts_with = "headless")]
    pub output: Option<PathBuf>,
    /// Hold the light against this: a folder that `rebake bake` wrote (open its scene.glb), or an EXR file
    #[arg(long, value_name = "DIR|EXR")]
    pub reference: Option<PathBuf>,
    /// At the end, write what frames took as JSON
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// No window: play a script to pictures
    #[arg(long, requires = "script", requires = "frames_dir")]
    pub headless: bool,
    /// What --headless plays: JSON, an edit, a camera or frames a line
    #[arg(long, value_name = "WALK.JSONL", requires = "headless")]
    pub script: Option<PathBuf>,
    /// Play the script again and again for so long, and add what memory it takes to --stats
    #[arg(long = "for", value_name = "SECONDS", requires = "headless", value_parser = positive)]
    pub seconds: Option<f32>,
    /// JPEG files instead of PNG
    #[arg(long, requires = "headless")]
    pub jpeg: bool,
    /// Where --headless writes frame_00000.png and so on
    #[arg(long, value_name = "DIR", requires = "headless")]
    pub frames_dir: Option<PathBuf>,
}

/// Width and height, pixels.
#[derive(Clone, Copy)]
pub struct Size(pub [u32; 2]);

impl Args {
    /// [`Args::frame_ms`] as a time.
    pub fn frame(&self) -> Option<Duration> {
        self.frame_ms.map(|ms| Duration::from_secs_f32(ms / 1e3))
    }
}

fn size(text: &str) -> Result<Size, String> {
    let bad = || "write two numbers like 1280x720, each between 16 and 8192".to_owned();
    let (width, height) = text.split_once('x').ok_or_else(bad)?;
    let side = |text: &str| {
        let side = text.parse::<u32>().ok();
        side.filter(|s| (16..=8192).contains(s)).ok_or_else(bad)
    };
    Ok(Size([side(width)?, side(height)?]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        use clap::CommandFactory as _;
        Args::command().debug_assert();
    }
}
