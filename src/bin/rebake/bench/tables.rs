//! What `rebake bench` prints of the figures.

use rebake::bench::{Better, Comparison, Figure, Point, SceneFigures, Series, number};

use super::grid::Grid;

/// A scene's tables.
pub fn of_scene(scene: &SceneFigures) -> Vec<String> {
    let mut tables = Vec::new();
    let timed = || {
        scene
            .figures
            .iter()
            .filter(|f| f.runs > 1 || !f.unit.is_empty())
    };
    if timed().next().is_some() {
        let heads = ["", "median", "least", "largest", ""].map(str::to_owned);
        let mut grid = Grid::new(scene.scene.clone(), heads);
        for f in timed() {
            let [median, min, max] = [f.median, f.min, f.max].map(number);
            grid.row([f.name.clone(), median, min, max, f.unit.clone()]);
        }
        tables.push(grid.to_string());
    }
    // The curves of edits are for plots: the figures say what people ask of them.
    let sweeps = scene.series.iter().filter(|s| s.over != "s");
    tables.extend(sweeps.map(|series| of_series(&scene.scene, series)));
    tables.extend(
        scene
            .missing
            .iter()
            .map(|m| format!("{}: {m}", scene.scene)),
    );
    tables
}

fn of_series(scene: &str, series: &Series) -> String {
    let figures = series.points.first().map_or(&[][..], |p| &p.figures);
    let heads = figures.iter().map(|f| match f.unit.as_str() {
        "" => f.name.clone(),
        unit => format!("{} [{unit}]", f.name),
    });
    let title = format!("{scene}: {}", series.name);
    let mut grid = Grid::new(title, std::iter::once(series.over.clone()).chain(heads));
    for point in &series.points {
        let cells = point.figures.iter().map(spread);
        grid.row(std::iter::once(number(point.at)).chain(cells));
    }
    let timed = (0..figures.len()).filter(|&i| figures[i].better == Better::Lower);
    // What a batch costs as a whole is shared by its lights.
    let shared = series.name == "batches";
    let shares = Series {
        points: series
            .points
            .iter()
            .map(|p| Point {
                at: 1.0 / p.at,
                ..p.clone()
            })
            .collect(),
        ..series.clone()
    };
    let lines = timed.filter_map(|i| {
        let line = if shared { &shares } else { series }.line(i)?;
        let Figure { name, unit, .. } = &figures[i];
        let (each, what) = match shared {
            true => (line.slope, "batch, shared by its lights".to_owned()),
            false => (1e3 * line.slope, format!("1000 {}", series.over)),
        };
        Some(format!(
            "\n  {name}: {} {unit} + {} {unit} per {what}, within {:.0} %",
            number(line.at_zero),
            number(each),
            100.0 * line.worst
        ))
    });
    let lines: String = lines.collect();
    format!("{grid}{lines}")
}

fn spread(f: &Figure) -> String {
    match f.better {
        Better::Neither => number(f.median),
        _ => format!(
            "{} ({} to {})",
            number(f.median),
            number(f.min),
            number(f.max)
        ),
    }
}

/// IBGI's table 1 and VPL13's table of pre-processing, over all scenes.
pub fn overview(scenes: &[SceneFigures]) -> String {
    let heads = [
        "",
        "triangles",
        "lights",
        "texels",
        "frame [ms]",
        "VL [ms]",
        "paths / bounces",
        "clusters",
        "VLs",
        "update size",
        "fps",
        "updates/s",
        "#T_uv",
        "#P_uv",
        "time [s]",
    ];
    let title =
        "scene characteristics and update performance (IBGI table 1), pre-processing (VPL13)";
    let mut grid = Grid::new(title, heads.map(str::to_owned));
    for scene in scenes {
        let find = |name: &str| scene.figures.iter().find(|f| f.name == name);
        let of = |name: &str| find(name).map_or_else(|| "-".into(), |f| number(f.median));
        // Over all scenarios.
        let mean = |name: &str| {
            let all: Vec<f64> = scene
                .figures
                .iter()
                .filter(|f| f.name.ends_with(&format!(": {name}")))
                .map(|f| f.median)
                .collect();
            match all.len() {
                0 => None,
                n => Some(all.iter().sum::<f64>() / n as f64),
            }
        };
        let text = |value: Option<f64>| value.map_or_else(|| "-".into(), number);
        // One update between two pictures.
        let frame = find("frame, device").map(|f| 1e-3 * f.median);
        let fps = frame
            .zip(mean("updates"))
            .map(|(frame, updates)| 1.0 / (frame + 1.0 / updates));
        let paths = match (find("paths"), find("VPLs")) {
            (Some(paths), Some(vpls)) => format!(
                "{} / {:.1}",
                number(paths.median),
                vpls.median / paths.median.max(1.0)
            ),
            _ => "-".into(),
        };
        grid.row([
            scene.scene.clone(),
            of("triangles"),
            of("lights"),
            of("texels"),
            of("frame, device"),
            of("virtual light"),
            paths,
            of("clusters"),
            of("virtual lights"),
            text(mean("update size")),
            text(fps),
            text(mean("updates")),
            of("T_uv"),
            of("P_uv"),
            of("stage: texels"),
        ]);
    }
    grid.to_string()
}

/// Ratios to an earlier run.
pub fn comparison(rows: &[Comparison]) -> String {
    let heads = ["", "before", "now", "", "times as good"].map(str::to_owned);
    let mut grid = Grid::new("compared with the earlier run", heads);
    for row in rows {
        let gain = format!("{:.2}", row.gain);
        grid.row([
            row.name.clone(),
            number(row.old),
            number(row.new),
            row.unit.clone(),
            gain,
        ]);
    }
    grid.to_string()
}
