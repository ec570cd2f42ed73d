//! convergence.png: the share of the first error that is left, over time.

use std::io::Cursor;

use anyhow::Context as _;
use image::{ImageFormat, RgbImage};
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};
use rebake::bake::{Moment, Replay, Step};
use rebake::scene::edit::Command;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 540);
/// Nothing below this share of the first error is drawn.
const LOWEST: f64 = 1e-6;
/// Nothing before this time is told apart where time is drawn by its logarithm, seconds.
const SOONEST: f64 = 0.03;
const VIEWPORT: RGBColor = RGBColor(0x1f, 0x5f, 0xa8);
const WHOLE: RGBColor = RGBColor(0x8a, 0xb4, 0xd8);
const REBAKE: RGBColor = RGBColor(0x60, 0x60, 0x60);
const EDIT: RGBColor = RGBColor(0xc0, 0x50, 0x20);
const GRID: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);

/// The plot as PNG: the RMS error of the map against the converged one after every update, as a share of what it was at
/// first, in what the camera sees and in the whole map; lines of the script that changed something as vertical lines, with
/// their numbers. With a `rebake` its way is drawn as well, and time by its logarithm.
///
/// # Errors
/// The encoder's or the font's.
pub fn convergence(
    replay: &Replay,
    script: &[(usize, Command)],
    rebake: Option<&[Moment]>,
) -> anyhow::Result<Vec<u8>> {
    png(SIZE, |area| draw(replay, script, rebake, area))
}

/// What is drawn on.
pub type Area<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;

/// A white picture of some size that `draw` draws on, as PNG. Its font is "sans-serif".
///
/// # Errors
/// The encoder's, the font's, or `draw`'s.
pub fn png(
    size: (u32, u32),
    draw: impl FnOnce(&Area) -> Result<(), Box<dyn std::error::Error>>,
) -> anyhow::Result<Vec<u8>> {
    // Known to the whole process; a second time changes nothing.
    register_font(
        "sans-serif",
        FontStyle::Normal,
        epaint_default_fonts::UBUNTU_LIGHT,
    )
    .map_err(|_| anyhow::anyhow!("the plot's font cannot be read"))?;
    let mut pixels = vec![0u8; 3 * size.0 as usize * size.1 as usize];
    let drawn = {
        let area = BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area();
        let cleared = area.fill(&WHITE).map_err(Into::into);
        cleared
            .and_then(|()| draw(&area))
            .and_then(|()| Ok(area.present()?))
    };
    drawn.map_err(|error| anyhow::anyhow!("drawing the plot: {error}"))?;
    let mut png = Vec::new();
    RgbImage::from_raw(size.0, size.1, pixels)
        .context("the plot has another size")?
        .write_to(&mut Cursor::new(&mut png), ImageFormat::Png)
        .context("encoding the plot")?;
    Ok(png)
}

/// A line of the plot: seconds, and the share that is left.
struct Curve {
    name: &'static str,
    color: RGBColor,
    points: Vec<(f64, f64)>,
}

/// What there is to draw. Where the map ends exactly as it should, a curve ends with the last point that is not 0.
fn curves(replay: &Replay, rebake: Option<&[Moment]>) -> Vec<Curve> {
    let (whole, viewport) = (replay.initial_rms, replay.initial_viewport);
    let curve = |name, color, first: f64, left: &dyn Fn(&Step) -> f64| {
        let steps = replay.steps.iter();
        let steps = steps.map(|s| (s.seconds, left(s) / first));
        let all = if first > 0.0 { 1.0 } else { 0.0 };
        Curve {
            name,
            color,
            points: std::iter::once((0.0, all)).chain(steps).collect(),
        }
    };
    let mut curves = vec![
        curve("updates, whole map", WHOLE, whole, &|s| s.rms),
        curve("updates, viewport", VIEWPORT, viewport, &|s| s.viewport),
    ];
    if let Some(moments) = rebake {
        let points = moments.iter().map(|m| (m.seconds, m.viewport / viewport));
        curves.push(Curve {
            name: "full rebake, viewport",
            color: REBAKE,
            points: points.collect(),
        });
    }
    for curve in &mut curves {
        let visible = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite() && p.1 > 0.0;
        curve.points.retain(visible);
    }
    curves.retain(|curve| !curve.points.is_empty());
    curves
}

fn draw(
    replay: &Replay,
    script: &[(usize, Command)],
    rebake: Option<&[Moment]>,
    area: &Area,
) -> Result<(), Box<dyn std::error::Error>> {
    let curves = curves(replay, rebake);
    let points = || curves.iter().flat_map(|c| &c.points);
    let last = points().map(|p| p.0).fold(replay.seconds, f64::max);
    let logarithmic = rebake.is_some();
    let along = |seconds: f64| {
        if logarithmic {
            seconds.max(SOONEST).log10()
        } else {
            seconds
        }
    };
    // Whole decades.
    let low = points().map(|p| p.1).fold(0.1f64, f64::min);
    let high = points().map(|p| p.1).fold(1.0f64, f64::max);
    let whole = |exponent: f64| 10f64.powf(exponent);
    let (low, high) = (
        whole(low.max(LOWEST).log10().floor()),
        whole(high.log10().ceil()),
    );

    let span = along(0.0)..along(last.max(2.0 * SOONEST));
    let mut chart = ChartBuilder::on(area)
        .caption(
            format!("{} updates in {:.2} s", replay.updates, replay.seconds),
            ("sans-serif", 22),
        )
        .margin(14)
        .x_label_area_size(42)
        .y_label_area_size(78)
        .build_cartesian_2d(span, (low..high).log_scale())?;
    chart
        .configure_mesh()
        .bold_line_style(GRID)
        .light_line_style(WHITE)
        .x_desc("seconds after the first edit")
        .y_desc("RMS error, share of the first")
        .x_label_formatter(&|x| {
            if logarithmic {
                format!("{:.2}", whole(*x))
            } else {
                format!("{x:.2}")
            }
        })
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
        let at = along(played.seconds);
        chart.draw_series(std::iter::once(PathElement::new(
            vec![(at, low), (at, high)],
            EDIT.mix(0.5),
        )))?;
        chart.draw_series(std::iter::once(Text::new(
            format!(" {}", played.line),
            (at, high),
            ("sans-serif", 13).into_font().color(&EDIT),
        )))?;
    }
    for Curve {
        name,
        color,
        points,
    } in curves
    {
        let visible = points.iter().map(|&(s, share)| (along(s), share.max(low)));
        chart
            .draw_series(LineSeries::new(visible, color.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 15))
        .draw()?;
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
            initial_viewport: 0.0,
            initial_mean: 0.0,
            mean: 0.0,
            beyond: 0.0,
            steps: Vec::new(),
            updates: 0,
            seconds: 0.0,
            lights: 0,
        };
        let moment = |seconds| Moment {
            seconds,
            updates: 1,
            rms: 0.0,
            viewport: 0.0,
        };
        for (rms, seconds) in [(0.0, 0.0), (1.0, 2.0), (f64::MIN_POSITIVE, 1e9)] {
            (replay.initial_rms, replay.initial_viewport) = (rms, rms);
            replay.seconds = seconds;
            for rebake in [None, Some(&[][..]), Some(&[moment(0.0), moment(1e6)])] {
                let png = convergence(&replay, &[], rebake).unwrap();
                let plot = image::load_from_memory(&png).unwrap();
                assert_eq!((plot.width(), plot.height()), SIZE);
            }
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
