//! How far the bake is, how fast it goes, and what frames cost.

use egui_plot::{Line, Plot, PlotPoints, VLine};

use super::super::state::Viewer;
use super::super::worker::Status;

/// Below this share of the largest value the curve is not followed.
const DEPTH: f64 = 1e-5;

const CURVE: egui::Color32 = egui::Color32::from_rgb(255, 170, 60);
const EDIT: egui::Color32 = egui::Color32::from_gray(110);

pub(super) fn progress(viewer: &mut Viewer, ui: &mut egui::Ui, status: &Status) {
    ui.heading("Light");
    let left = status.progress.map_or(0, |p| p.left);
    let state = match (status.preparing, status.converged, status.paused) {
        (Some(what), ..) => format!("preparing: {what}"),
        (_, true, _) => "converged".to_owned(),
        (_, _, true) => "paused".to_owned(),
        _ => format!("{left} updates left"),
    };
    egui::Grid::new("progress").num_columns(2).show(ui, |ui| {
        let mut row = |name: &str, value: String| {
            ui.weak(name);
            ui.label(value);
            ui.end_row();
        };
        row("state", state);
        row(
            "updates",
            format!("{} ({:.0}/s)", status.updates, status.rate),
        );
        if let Some(progress) = status.progress {
            row("invalid flux", format!("{:.4} lm", progress.invalid_flux));
            row("invalid paths", progress.invalid_paths.to_string());
        }
        if status.texels > 0 {
            row("texels", status.texels.to_string());
            row("virtual lights", status.lights.to_string());
        }
        let (median, worst) = frame_times(&viewer.frame_ms);
        row("frame", format!("{median:.1} ms, 99 %: {worst:.1} ms"));
        let mib = viewer.device_bytes as f64 / f64::from(1 << 20);
        row("device memory", format!("{mib:.0} MiB at most"));
        row("flying", format!("{:.2} m/s", viewer.speed));
    });
    curve(ui, status);
    ui.horizontal(|ui| {
        ui.label("updates per frame");
        let mut slice = status.slice.as_secs_f32() * 1e3;
        let slider = egui::Slider::new(&mut slice, 1.0..=500.0).logarithmic(true);
        if ui.add(slider.suffix(" ms").fixed_decimals(0)).changed() {
            let request = super::slice_of(slice);
            viewer.ask(request);
        }
    });
    ui.collapsing("device time per pass", |ui| {
        egui::Grid::new("passes").num_columns(2).show(ui, |ui| {
            for (name, ms) in &viewer.passes {
                ui.weak(*name);
                ui.label(format!("{ms:.2} ms/s"));
                ui.end_row();
            }
        });
    });
}

/// The median, and what one frame of a hundred exceeds.
pub(in super::super) fn frame_times(ms: &[f32]) -> (f32, f32) {
    let mut sorted = ms.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = |share: f32| {
        let last = sorted.len().saturating_sub(1);
        sorted.get((last as f32 * share) as usize).copied()
    };
    (at(0.5).unwrap_or(0.0), at(0.99).unwrap_or(0.0))
}

/// Invalid flux over time, in powers of ten; edits as lines.
fn curve(ui: &mut egui::Ui, status: &Status) {
    let most = status.curve.iter().map(|p| p[1]).fold(0.0, f64::max);
    if most <= 0.0 {
        return;
    }
    let points: PlotPoints = status
        .curve
        .iter()
        .map(|[seconds, flux]| [*seconds, (flux / most).max(DEPTH).log10()])
        .collect();
    ui.weak("share of the light that is not right yet");
    Plot::new("convergence")
        .height(130.0)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .include_y(0.0)
        .include_y(-3.0)
        .y_axis_formatter(|mark, _| format!("{:.3} %", 10f64.powf(mark.value + 2.0)))
        .x_axis_formatter(|mark, _| format!("{:.0} s", mark.value))
        .show(ui, |plot| {
            for seconds in &status.edits {
                plot.vline(VLine::new("edit", *seconds).color(EDIT));
            }
            plot.line(Line::new("invalid flux", points).color(CURVE));
        });
}

#[cfg(test)]
mod tests {
    use super::frame_times;

    #[test]
    fn one_slow_frame_of_a_thousand_is_not_the_99th() {
        let mut ms = vec![10.0; 999];
        ms.push(500.0);
        assert_eq!(frame_times(&ms), (10.0, 10.0));
        ms.extend([100.0; 20]);
        assert_eq!(frame_times(&ms), (10.0, 100.0));
        assert_eq!(frame_times(&[]), (0.0, 0.0));
    }
}
