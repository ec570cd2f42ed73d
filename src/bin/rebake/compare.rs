//! `rebake compare`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use rebake::lightmap::compare::{Comparison, Pair};
use rebake::scene::write_whole;

use super::args;
use super::console::print;

/// Relative error that takes the full colour.
const FULL: f32 = 0.25;

pub fn run(args: &args::Args, command: &args::Compare) -> anyhow::Result<()> {
    let pair = Pair::load(&command.a, &command.b)?;
    let comparison = pair.compare();
    if let Some(path) = &command.output {
        let pages = pair
            .false_colour(FULL)
            .context("encoding the false colours")?;
        let many = pages.len() > 1;
        for (k, png) in pages.iter().enumerate() {
            write_whole(
                &if many {
                    numbered(path, k)
                } else {
                    path.clone()
                },
                png,
            )?;
        }
    }
    if args.json {
        print(serde_json::to_string(&comparison)?)?;
    } else if !args.quiet {
        show(&comparison)?;
    }
    Ok(())
}

/// `name.png` becomes `name_K.png`.
fn numbered(path: &Path, k: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{k}.png"))
}

fn show(c: &Comparison) -> anyhow::Result<()> {
    let percent = |v: f64| v * 100.0;
    print(format_args!(
        "{} lit texels, {} differ, {} not finite",
        c.texels, c.different, c.not_finite
    ))?;
    print(format_args!(
        "mean {:.6} and {:.6} lux, bias {:+.3} %, RMSE {:.6} lux",
        c.mean_a,
        c.mean_b,
        percent(c.bias),
        c.rmse
    ))?;
    let r = &c.relative;
    print(format_args!(
        "relative error: median {:.3} %, 95th percentile {:.3} %, 99th {:.3} %, largest {:.3} %",
        percent(r.p50),
        percent(r.p95),
        percent(r.p99),
        percent(r.max)
    ))?;
    for w in &c.worst {
        print(format_args!(
            "page {} ({}, {}): {:?} for {:?}, {:+.1} %",
            w.page,
            w.x,
            w.y,
            w.a,
            w.b,
            percent(w.relative)
        ))?;
    }
    Ok(())
}
