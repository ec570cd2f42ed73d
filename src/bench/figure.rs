//! Numbers with their spread: the median of some runs between the least and the largest.

use serde::{Deserialize, Serialize};

/// Which way a figure should go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// Times and sizes.
    Lower,
    /// Rates.
    Higher,
    /// Counts: what the work was, not how well it was done.
    Neither,
}

/// What was measured, over some runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// Its unit; empty for counts.
    pub unit: String,
    /// Which way it should go.
    pub better: Better,
    /// The middle one; the mean of the two in the middle if the runs are even in number.
    pub median: f64,
    /// The least.
    pub min: f64,
    /// The largest.
    pub max: f64,
    /// How many.
    pub runs: u32,
}

impl Figure {
    /// A figure of some runs, at least one.
    pub fn new(
        name: impl Into<String>,
        unit: &str,
        better: Better,
        runs: impl IntoIterator<Item = f64>,
    ) -> Self {
        let mut runs: Vec<f64> = runs.into_iter().collect();
        runs.sort_unstable_by(f64::total_cmp);
        let n = runs.len();
        assert!(n > 0, "a figure has runs");
        Self {
            name: name.into(),
            unit: unit.into(),
            better,
            median: 0.5 * (runs[(n - 1) / 2] + runs[n / 2]),
            min: runs[0],
            max: runs[n - 1],
            runs: n as u32,
        }
    }

    /// What does not change from run to run.
    pub fn count(name: impl Into<String>, value: f64) -> Self {
        Self::new(name, "", Better::Neither, [value])
    }
}

impl std::fmt::Display for Figure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, unit, .. } = self;
        write!(f, "{name} {} {unit}", number(self.median))
    }
}

/// Three figures' worth of a number, as people write it.
pub fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        s if s == 0.0 || !s.is_finite() => format!("{value}"),
        s if s >= 1e6 && value.fract() != 0.0 => format!("{value:.3e}"),
        s if s >= 100.0 => format!("{value:.0}"),
        s if s >= 10.0 => format!("{value:.1}"),
        s if s >= 1.0 => format!("{value:.2}"),
        s if s >= 0.01 => format!("{value:.3}"),
        _ => format!("{value:.2e}"),
    }
}

/// A figure, or several, over something that is varied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// What it shows.
    pub name: String,
    /// What is varied.
    pub over: String,
    /// In order.
    pub points: Vec<Point>,
}

/// A point of a series.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Where.
    pub at: f64,
    /// What was measured there; the same names in the same order at every point.
    pub figures: Vec<Figure>,
}

/// The straight line through some points that misses them by least, each miss taken relative to the point's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Where it meets 0 of what is varied.
    pub at_zero: f64,
    /// What one more of what is varied costs.
    pub slope: f64,
    /// The furthest that a point lies from it, of the point's value.
    pub worst: f64,
}

impl Series {
    /// How much like a straight line one of the figures is; none of fewer than three points above 0.
    pub fn line(&self, figure: usize) -> Option<Line> {
        let points = self.points.iter();
        let points: Vec<(f64, f64)> = points
            .map(|p| (p.at, p.figures[figure].median))
            .filter(|(x, y)| x.is_finite() && *y > 0.0)
            .collect();
        if points.len() < 3 {
            return None;
        }
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            points.iter().map(|&(x, y)| of(x, y) / (y * y)).sum()
        };
        let (n, x, y) = (sum(&|_, _| 1.0), sum(&|x, _| x), sum(&|_, y| y));
        let (xx, xy) = (sum(&|x, _| x * x), sum(&|x, y| x * y));
        let determinant = n * xx - x * x;
        if determinant <= 0.0 {
            return None;
        }
        let slope = (n * xy - x * y) / determinant;
        let at_zero = (y - slope * x) / n;
        let miss = |&(x, y): &(f64, f64)| ((at_zero + slope * x - y) / y).abs();
        let worst = points.iter().map(miss).fold(0.0, f64::max);
        Some(Line {
            at_zero,
            slope,
            worst,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_lie_in_the_middle() {
        let of = |runs: &[f64]| Figure::new("x", "s", Better::Lower, runs.iter().copied());
        let f = of(&[3.0, 1.0, 2.0]);
        assert_eq!((f.min, f.median, f.max, f.runs), (1.0, 2.0, 3.0, 3));
        assert_eq!(of(&[4.0, 1.0, 2.0, 3.0]).median, 2.5);
        assert_eq!(Figure::count("n", 7.0).median, 7.0);
        let numbers = [0.0, 1234.0, 12.34, 1.234, 0.1234, 0.00012].map(number);
        assert_eq!(numbers, ["0", "1234", "12.3", "1.23", "0.123", "1.20e-4"]);
    }

    #[test]
    fn lines_go_through_what_lies_on_them() {
        let series = |y: &dyn Fn(f64) -> f64| Series {
            name: "s".into(),
            over: "n".into(),
            points: [1.0, 10.0, 1000.0]
                .map(|at| Point {
                    at,
                    figures: vec![Figure::count("y", y(at))],
                })
                .to_vec(),
        };
        let line = series(&|x| 3.0 + 0.5 * x).line(0).unwrap();
        assert!((line.at_zero - 3.0).abs() < 1e-9 && (line.slope - 0.5).abs() < 1e-9);
        assert!(line.worst < 1e-9);
        assert!(series(&|x| x * x).line(0).unwrap().worst > 0.5);
        assert_eq!(series(&|_| 0.0).line(0), None);
    }
}
