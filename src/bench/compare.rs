//! Two runs of the benchmark side by side: ratios, and which of them have got worse.

use std::collections::BTreeMap;

use super::figure::{Better, Figure};
use super::{Figures, SceneFigures};

/// A figure that both runs have.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Scene, series, place in it, and name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The earlier median.
    pub old: f64,
    /// The later one.
    pub new: f64,
    /// How many times as good the later one is: above 1 is better, whichever way the figure should go.
    pub gain: f64,
}

/// Every figure that has a better and a worse and that both runs have, in the order of the new run.
pub fn compare(old: &Figures, new: &Figures) -> Vec<Comparison> {
    let before: BTreeMap<String, &Figure> = old.scenes.iter().flat_map(named).collect();
    let after = new.scenes.iter().flat_map(named);
    after
        .filter_map(|(name, figure)| {
            let earlier = before.get(&name)?;
            let (old, new) = (earlier.median, figure.median);
            let gain = match figure.better {
                Better::Lower => old / new,
                Better::Higher => new / old,
                Better::Neither => return None,
            };
            (gain.is_finite() && gain > 0.0).then(|| Comparison {
                name,
                unit: figure.unit.clone(),
                old,
                new,
                gain,
            })
        })
        .collect()
}

fn named(scene: &SceneFigures) -> impl Iterator<Item = (String, &Figure)> {
    let own = scene
        .figures
        .iter()
        .map(move |f| (format!("{}: {}", scene.scene, f.name), f));
    let along = scene.series.iter().flat_map(move |series| {
        series.points.iter().flat_map(move |point| {
            let at = format!(
                "{}: {}, {} {}",
                scene.scene, series.name, point.at, series.over
            );
            point
                .figures
                .iter()
                .map(move |f| (format!("{at}: {}", f.name), f))
        })
    });
    own.chain(along)
}

#[cfg(test)]
mod tests {
    use super::super::{Point, Series};
    use super::*;

    fn run(seconds: f64, rate: f64) -> Figures {
        Figures {
            generator: String::new(),
            device: String::new(),
            driver: String::new(),
            cpu: String::new(),
            threads: 1,
            seed: 0,
            settings: String::new(),
            repeats: 1,
            warm_up: 0,
            scenes: vec![SceneFigures {
                scene: "room".into(),
                figures: vec![
                    Figure::new("bake", "s", Better::Lower, [seconds]),
                    Figure::count("texels", seconds),
                ],
                series: vec![Series {
                    name: "edits".into(),
                    over: "cells".into(),
                    points: vec![Point {
                        at: 100.0,
                        figures: vec![Figure::new("updates", "1/s", Better::Higher, [rate])],
                    }],
                }],
                missing: Vec::new(),
            }],
        }
    }

    #[test]
    fn gains_point_up_whichever_way_a_figure_should_go() {
        let rows = compare(&run(2.0, 10.0), &run(1.0, 5.0));
        let gains: Vec<_> = rows.iter().map(|r| (r.name.as_str(), r.gain)).collect();
        assert_eq!(
            gains,
            [
                ("room: bake", 2.0),
                ("room: edits, 100 cells: updates", 0.5)
            ]
        );
        let mut other = run(1.0, 1.0);
        other.scenes[0].scene = "hall".into();
        assert!(compare(&other, &run(1.0, 1.0)).is_empty());
    }
}
