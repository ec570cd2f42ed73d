//! convergence.png: the share of the first error that is left, over time.

use std::io::Cursor;

use anyhow::Context as _;
use image::{ImageFormat, RgbImage};
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};
use rebake::bake::Replay;
use rebake::scene::edit::Command;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 540);
/// Nothing below this share of the first error is drawn.
const LOWEST: f64 = 1e-6;
const CURVE: RGBColor = RGBColor(0x1f, 0x5f, 0xa8);
const EDIT: RGBColor = RGBColor(0xc0, 0x50, 0x20);
const GRID: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);

/// The plot as PNG: the RMS error of the map against the converged one after every update, as a share of what it was at first;
/// lines of the script that changed something as vertical lines, with their numbers.
///
/// # Errors
/// The encoder's or the font's.
pub fn convergence(replay: &Replay, script: &[(usize, Command)]) -> anyhow::Result<Vec<u8>> {
    // Known to the whole process; a second time changes nothing.
    register_font(
        "sans-serif",
        FontStyle::Normal,
        epaint_default_fonts::UBUNTU_LIGHT,
    )
    .map_err(|_| anyhow::anyhow!("the plot's font cannot be read"))?;
    let mut pixels = vec![0u8; 3 * SIZE.0 as usize * SIZE.1 as usize];
    draw(replay, script, &mut pixels)
        .map_err(|error| anyhow::anyhow!("drawing the plot: {error}"))?;
    let mut png = Vec::new();
    RgbImage::from_raw(SIZE.0, SIZE.1, pixels)
        .context("the plot has another size")?
        .write_to(&mut Cursor::new(&mut png), ImageFormat::Png)
        .context("encoding the plot")?;
    Ok(png)
}

/// The curve's points: seconds, and the share that is left. Where the map ends exactly as it should, the curve
/// ends with the last point that is not 0.
fn points(replay: &Replay) -> Vec<(f64, f64)> {
    let share = |rms: f64| rms / replay.initial_rms;
    let steps = replay.steps.iter().map(|s| (s.seconds, share(s.rms)));
    std::iter::once((0.0, 1.0))
        .chain(steps)
        .filter(|(_, share)| share.is_finite() && *share > 0.0)
        .collect()
}

fn draw(
    replay: &Replay,
    script: &[(usize, Command)],
    pixels: &mut [u8],
) -> Result<(), Box<dyn std::error::Error>> {
    let points = points(replay);
    let last = replay.seconds.max(1e-3);
    let values = || points.iter().map(|p| p.1);
    // Whole decades.
    let low = values().fold(0.1f64, f64::min).max(LOWEST).log10().floor();
    let high = values().fold(1.0f64, f64::max).log10().ceil();
    let (low, high) = (10f64.powf(low), 10f64.powf(high));

    let area = BitMapBackend::with_buffer(pixels, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(
            format!("{} updates in {:.2} s", replay.updates, replay.seconds),
            ("sans-serif", 22),
        )
        .margin(14)
        .x_label_area_size(42)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..last, (low..high).log_scale())?;
    chart
        .configure_mesh()
        .bold_line_style(GRID)
        .light_line_style(WHITE)
        .x_desc("seconds after the first edit")
        .y_desc("RMS error of the map, share of the first")
        .x_label_formatter(&|s| format!("{s:.2}"))
        .y_label_formatter(&|share| percent(*share))
        .label_style(("sans-serif", 15))
        .axis_desc_style(("sans-serif", 17))
        .draw()?;
    let waits = |line| {
        let mut command = script.iter().filter(|(l, _)| *l == line);
        command.any(|(_, c)| matches!(c, Command::Wait(_)))
    };
    let played = replay.script.iter();
    for played in played.filter(|p| p.refused.is_none() && !waits(p.line)) {
        chart.draw_series(std::iter::once(PathElement::new(
            vec![(played.seconds, low), (played.seconds, high)],
            EDIT.mix(0.5),
        )))?;
        chart.draw_series(std::iter::once(Text::new(
            format!(" {}", played.line),
            (played.seconds, high),
            ("sans-serif", 13).into_font().color(&EDIT),
        )))?;
    }
    let visible = points.iter().map(|&(s, share)| (s, share.max(low)));
    chart.draw_series(LineSeries::new(visible, CURVE.stroke_width(2)))?;
    area.present()?;
    Ok(())
}

/// 1 as 100 %, 0.0001 as 0.01 %.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let digits = (-percent.log10()).ceil().max(0.0) as usize;
    format!("{percent:.digits$} %")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_is_drawn_whatever_there_is_to_draw() {
        let mut replay = Replay {
            script: Vec::new(),
            initial_rms: 0.0,
            mean: 0.0,
            steps: Vec::new(),
            updates: 0,
            seconds: 0.0,
            lights: 0,
        };
        for (initial_rms, seconds) in [(0.0, 0.0), (1.0, 2.0), (f64::MIN_POSITIVE, 1e9)] {
            (replay.initial_rms, replay.seconds) = (initial_rms, seconds);
            let png = convergence(&replay, &[]).unwrap();
            let plot = image::load_from_memory(&png).unwrap();
            assert_eq!((plot.width(), plot.height()), SIZE);
        }
    }

    #[test]
    fn labels_have_the_digits_they_need() {
        let labels = [1.0, 10.0, 0.1, 0.01, 1e-3, 1e-4].map(percent);
        assert_eq!(
            labels,
            ["100 %", "1000 %", "10 %", "1 %", "0.1 %", "0.01 %"]
        );
    }
}
