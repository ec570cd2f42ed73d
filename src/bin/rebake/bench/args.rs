//! The options of `rebake bench`, in clap's words.

use std::path::PathBuf;

use rebake::bake::Quality;

use crate::values::count;

#[derive(clap::Args)]
pub struct Bench {
    /// Built-in scenes by name, or glTF files [default: museum town-square warehouse]
    pub scenes: Vec<String>,
    /// Measure only these
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PART,...")]
    pub only: Vec<Part>,
    /// Runs that count; the median, the least and the largest are reported
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: u32,
    /// Runs before them that do not count
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub warm_up: u32,
    /// Write all figures as JSON
    #[arg(short, long, value_name = "JSON")]
    pub output: Option<PathBuf>,
    /// Draw every sweep, and how maps follow edits, as PNG files in this folder
    #[arg(long, value_name = "DIR")]
    pub plots: Option<PathBuf>,
    /// Print the ratios to an earlier run's figures, and fail where one has got worse
    #[arg(long, value_name = "JSON")]
    pub compare: Option<PathBuf>,
    /// How many times as bad a figure may be with --compare
    #[arg(long, value_name = "RATIO", default_value_t = 1.2, value_parser = ratio)]
    pub threshold: f64,
    /// Also measure how the map follows these edits
    #[arg(long, value_name = "JSONL")]
    pub script: Vec<PathBuf>,
    /// Preset of all bakes [default: preview]
    #[arg(long, value_enum)]
    pub quality: Option<Quality>,
    /// Texels of all bakes [default: 1M, but at most 100 texels/m]
    #[arg(long, value_name = "N", value_parser = count)]
    pub texels: Option<u64>,
    /// Cells of all bakes [default: as many as the preset's error needs]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub clusters: Option<u32>,
    /// Light paths of all bakes
    #[arg(long, value_name = "N", value_parser = count)]
    pub paths: Option<u64>,
    /// Pixels along the edge of an indirect light's shadow map
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(8..=1024))]
    pub shadow_size: Option<u32>,
    /// Chooses the random sequences
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Paths at which the creation of virtual lights is timed
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = count)]
    pub sweep_paths: Vec<u64>,
    /// Texels at which a virtual light is timed
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = count)]
    pub sweep_texels: Vec<u64>,
    /// Triangles at which depth maps are timed
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = count)]
    pub sweep_triangles: Vec<u64>,
    /// Lights of a batch at which a virtual light is timed
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = clap::value_parser!(u64).range(1..=32))]
    pub sweep_batches: Vec<u64>,
    /// Cells at which lights and edits are timed
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = count)]
    pub sweep_cells: Vec<u64>,
}

/// [`rebake::bench::Part`] on the command line.
#[derive(Clone, Copy, clap::ValueEnum)]
pub enum Part {
    /// Whole bakes: IBGI's table 1, VPL13's pre-processing, stages, passes, rates
    Table,
    /// Virtual light creation over VPLs
    Creation,
    /// A virtual light over texels
    Texels,
    /// Depth maps over triangles
    Triangles,
    /// A virtual light over the size of batches
    Batches,
    /// Lights and edits over cells
    Cells,
    /// How the map follows edits
    Response,
    /// An edit's updates limited to the shadows of what it changed, beside whole ones: the same bits, or it fails
    Limits,
}

impl Part {
    pub fn part(self) -> rebake::bench::Part {
        use rebake::bench::Part as To;
        match self {
            Part::Table => To::Table,
            Part::Creation => To::Creation,
            Part::Texels => To::Texels,
            Part::Triangles => To::Triangles,
            Part::Batches => To::Batches,
            Part::Cells => To::Cells,
            Part::Response => To::Response,
            Part::Limits => To::Limits,
        }
    }
}

fn ratio(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value.is_finite() && value >= 1.0 {
        Ok(value)
    } else {
        Err("must be 1 or more".into())
    }
}
