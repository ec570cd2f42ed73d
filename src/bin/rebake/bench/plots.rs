//! Pictures of sweeps: a figure of each unit over what was varied, and how maps follow edits.

use std::ops::Range;
use std::path::{Path, PathBuf};

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use rebake::bench::{Figure, Figures, SceneFigures, Series, number};
use rebake::scene::write_whole;

use crate::plot;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 540);
/// Told apart in a grey print, too.
const COLORS: [RGBColor; 6] = [
    RGBColor(0x1f, 0x5f, 0xa8),
    RGBColor(0xc0, 0x50, 0x20),
    RGBColor(0x30, 0x80, 0x40),
    RGBColor(0x7a, 0x3f, 0x98),
    RGBColor(0x90, 0x70, 0x10),
    RGBColor(0x50, 0x50, 0x50),
];
const GRID: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);

/// Writes every plot there is into a folder and returns the files.
pub fn write(folder: &Path, figures: &Figures) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for scene in &figures.scenes {
        for (name, plot) in of_scene(scene) {
            let path = folder.join(format!("{name}.png"));
            let below = format!("{}, {}, {}", figures.device, figures.cpu, figures.settings);
            write_whole(&path, &plot.png(&below)?)?;
            files.push(path);
        }
    }
    Ok(files)
}

/// A plot to be drawn.
struct Plot {
    title: String,
    x: String,
    y: String,
    curves: Vec<Curve>,
}

/// A line: what it is, and its points with their spread.
struct Curve {
    name: String,
    points: Vec<Spread>,
}

struct Spread {
    x: f64,
    y: f64,
    low: f64,
    high: f64,
}

/// File names and plots.
fn of_scene(scene: &SceneFigures) -> Vec<(String, Plot)> {
    let stem = Path::new(&scene.scene).file_stem().unwrap_or_default();
    let stem = stem.to_string_lossy();
    let (responses, sweeps): (Vec<&Series>, Vec<_>) =
        scene.series.iter().partition(|s| s.over == "s");
    let mut plots = Vec::new();
    for series in sweeps {
        let first = series.points.first().map_or(&[][..], |p| &p.figures);
        let mut units: Vec<&str> = first.iter().map(|f| f.unit.as_str()).collect();
        units.retain(|u| !u.is_empty());
        units.sort_unstable();
        units.dedup();
        for unit in units {
            let of_unit = (0..first.len()).filter(|&i| first[i].unit == unit);
            let curves: Vec<Curve> = of_unit.map(|i| curve(series, i)).collect();
            let names: Vec<_> = curves.iter().map(|c| c.name.as_str()).collect();
            let what = match names.as_slice() {
                [only] => (*only).to_owned(),
                _ => "time".to_owned(),
            };
            plots.push((
                file_name(&format!("{stem} {} {unit}", series.name)),
                Plot {
                    title: format!("{stem}: {}", series.name),
                    x: series.over.clone(),
                    y: format!("{what} [{unit}]"),
                    curves,
                },
            ));
        }
    }
    if !responses.is_empty() {
        let curve = |s: &&Series| Curve {
            name: s.name.trim_start_matches("response: ").to_owned(),
            ..curve(s, 0)
        };
        plots.push((
            file_name(&format!("{stem} response")),
            Plot {
                title: format!("{stem}: how the map follows edits"),
                x: "seconds after the edit".into(),
                y: "RMS error left [%]".into(),
                curves: responses.iter().map(curve).collect(),
            },
        ));
    }
    plots
}

fn curve(series: &Series, figure: usize) -> Curve {
    let at = |f: &Figure, x: f64| Spread {
        x,
        y: f.median,
        low: f.min,
        high: f.max,
    };
    let points = series.points.iter();
    Curve {
        name: series.points[0].figures[figure].name.clone(),
        points: points.map(|p| at(&p.figures[figure], p.at)).collect(),
    }
}

fn file_name(text: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let text = text.replace("1/s", "per second");
    let name: String = text.trim().chars().map(plain).collect();
    name.to_lowercase()
}

/// A span whose ends differ, by logarithms where it holds more than a decade of numbers above 0.
#[derive(Clone)]
struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64> + Clone, from_zero: bool) -> Self {
        let (low, high) = (values.clone(), values);
        let (low, high) = (low.fold(f64::MAX, f64::min), high.fold(f64::MIN, f64::max));
        let logarithmic = low > 0.0 && high > 8.0 * low;
        match logarithmic {
            true => Self {
                low: (low / 1.15).log10(),
                high: (high * 1.15).log10(),
                logarithmic,
            },
            false => {
                let low = if from_zero { low.min(0.0) } else { low };
                let wide = (high - low).max(1e-9 * high.abs()).max(f64::MIN_POSITIVE);
                Self {
                    low,
                    high: high + 0.05 * wide,
                    logarithmic,
                }
            }
        }
    }

    fn at(&self, value: f64) -> f64 {
        let value = if self.logarithmic {
            value.max(f64::MIN_POSITIVE).log10()
        } else {
            value
        };
        value.clamp(self.low, self.high)
    }

    /// Round numbers on it, as places.
    fn ticks(&self) -> Vec<f64> {
        if !self.logarithmic {
            let wide = self.high - self.low;
            let tenth = 10f64.powf(wide.log10().floor() - 1.0);
            let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * tenth);
            let step = steps.into_iter().find(|s| wide / s <= 8.0);
            let step = step.unwrap_or(20.0 * tenth);
            let first = (self.low / step).ceil();
            let ticks = (0..16).map(|i| (first + f64::from(i)) * step);
            return ticks.filter(|t| *t <= self.high).collect();
        }
        // Over few decades 1, 2 and 5 of each, else 1.
        let decades = self.low.floor() as i32..=self.high.ceil() as i32;
        let parts: &[f64] = match self.high - self.low {
            wide if wide > 4.0 => &[1.0],
            _ => &[1.0, 2.0, 5.0],
        };
        decades
            .flat_map(|d| parts.iter().map(move |p| f64::from(d) + p.log10()))
            .filter(|t| (self.low..=self.high).contains(t))
            .collect()
    }

    /// What a place on it stands for.
    fn label(&self, at: f64) -> String {
        let value = if self.logarithmic { 10f64.powf(at) } else { at };
        match value.abs() {
            v if v >= 1e6 => format!("{} M", short(value / 1e6)),
            v if v >= 1e4 => format!("{} k", short(value / 1e3)),
            _ => short(value),
        }
    }
}

/// A number without zeros that say nothing.
fn short(value: f64) -> String {
    let text = number(value);
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, place: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (place - self.low) / (self.high - self.low);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl Plot {
    fn png(&self, below: &str) -> anyhow::Result<Vec<u8>> {
        plot::png(SIZE, |area| self.draw(area, below))
    }

    fn draw(&self, area: &plot::Area, below: &str) -> Result<(), Box<dyn std::error::Error>> {
        // A share of 0 ends a curve that is drawn by logarithms.
        let visible = |p: &&Spread| p.x.is_finite() && p.y.is_finite() && p.y > 0.0;
        let points = || {
            let curves = self.curves.iter();
            curves.flat_map(move |c| c.points.iter().filter(visible))
        };
        if points().next().is_none() {
            return Ok(());
        }
        let x = Axis::new(points().map(|p| p.x), false);
        let y = Axis::new(points().flat_map(|p| [p.low.max(0.2 * p.y), p.high]), true);
        let (upper, lower) = area.split_vertically(SIZE.1 - 26);
        lower.draw_text(below, &("sans-serif", 13).into_text_style(&lower), (14, 2))?;
        let mut chart = ChartBuilder::on(&upper)
            .caption(&self.title, ("sans-serif", 22))
            .margin(14)
            .x_label_area_size(42)
            .y_label_area_size(84)
            .build_cartesian_2d(x.clone(), y.clone())?;
        chart
            .configure_mesh()
            .bold_line_style(GRID)
            .light_line_style(WHITE)
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&|at| x.label(*at))
            .y_label_formatter(&|at| y.label(*at))
            .label_style(("sans-serif", 15))
            .axis_desc_style(("sans-serif", 17))
            .draw()?;
        for (curve, color) in self.curves.iter().zip(COLORS.iter().cycle()) {
            let points: Vec<&Spread> = curve.points.iter().filter(visible).collect();
            let at = |p: &&Spread| (x.at(p.x), y.at(p.y));
            chart
                .draw_series(LineSeries::new(
                    points.iter().map(at),
                    color.stroke_width(2),
                ))?
                .label(&curve.name)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2))
                });
            // Few points are measured ones, each with its spread.
            if points.len() <= 16 {
                chart.draw_series(points.iter().map(|p| Circle::new(at(p), 3, color.filled())))?;
                chart.draw_series(points.iter().map(|p| {
                    let ends = [p.low, p.high].map(|v| (x.at(p.x), y.at(v)));
                    PathElement::new(ends, color.mix(0.5).stroke_width(1))
                }))?;
            }
        }
        // Where there is room.
        let ends = |c: &Curve| Some((c.points.first()?.y, c.points.last()?.y));
        let rises = self
            .curves
            .first()
            .and_then(ends)
            .is_some_and(|(a, b)| a < b);
        chart
            .configure_series_labels()
            .position(if rises {
                SeriesLabelPosition::UpperLeft
            } else {
                SeriesLabelPosition::UpperRight
            })
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 15))
            .draw()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rebake::bench::{Better, Point};

    use super::*;

    #[test]
    fn every_unit_of_a_sweep_has_a_picture_whatever_its_numbers() {
        for (value, at) in [(0.0, [0.0, 0.0]), (1.0, [1.0, 1e9]), (1e-12, [5.0, 6.0])] {
            let figures = ["ms", "ms", "1/s", ""];
            let figures = figures.map(|u| Figure::new(u, u, Better::Lower, [value, 2.0 * value]));
            let points = at.map(|at| Point {
                at,
                figures: figures.to_vec(),
            });
            let series = |name: &str, over: &str| Series {
                name: name.into(),
                over: over.into(),
                points: points.to_vec(),
            };
            let scene = SceneFigures {
                scene: "a/b c.gltf".into(),
                figures: Vec::new(),
                series: vec![series("cells", "cells"), series("response: move", "s")],
                missing: Vec::new(),
            };
            let plots = of_scene(&scene);
            let names: Vec<_> = plots.iter().map(|p| p.0.as_str()).collect();
            let wanted = ["b-c-cells-per-second", "b-c-cells-ms", "b-c-response"];
            assert_eq!(names, wanted);
            for (_, plot) in plots {
                let picture = image::load_from_memory(&plot.png("here").unwrap()).unwrap();
                assert_eq!((picture.width(), picture.height()), SIZE);
            }
        }
    }

    #[test]
    fn axes_name_what_lies_on_them() {
        let axis = Axis::new([1e4, 4e6].into_iter(), false);
        assert!(axis.logarithmic);
        assert_eq!(axis.label(axis.at(1e6)), "1 M");
        assert_eq!(axis.label(axis.at(1e5)), "100 k");
        let labels: Vec<_> = axis.ticks().iter().map(|&t| axis.label(t)).collect();
        assert_eq!(labels[..4], ["10 k", "20 k", "50 k", "100 k"]);
        let axis = Axis::new([3.0, 5.0].into_iter(), true);
        assert_eq!((axis.low, axis.logarithmic), (0.0, false));
        assert_eq!(axis.ticks(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}
