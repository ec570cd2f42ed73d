//! What limiting an edit's updates to the shadows of what it changed is worth.

use super::figure::{Better, Figure};
use super::response::{self, Scenario};
use super::{Bench, BenchError};
use crate::bake::{Baker, Limit, LimitCosts, Silent};
use crate::scene::edit::{Command, Edit};

impl Bench<'_> {
    pub(super) fn limits(&mut self) -> Result<(), BenchError> {
        let scenarios = response::all(self);
        if scenarios.is_empty() {
            let why = "limits: the scene has no scenario; --script FILE gives it one";
            self.out.missing.push(why.into());
            return Ok(());
        }
        let walls = response::walls()?;
        self.tell("limits: baking the scene once");
        let (scene, document) = (self.scene.clone(), self.document.clone());
        let mut baker = Baker::new(self.gpu, scene, document, &self.plan.job, &Silent)?;
        baker.step(Limit::Converged)?;
        for scenario in &scenarios {
            let Some(edits) = edits(scenario) else {
                let why = "its script does more than edit";
                self.out
                    .missing
                    .push(format!("limits: {}: {why}", scenario.name));
                continue;
            };
            let folder = scenario.folder.as_deref().unwrap_or(walls.path());
            let runs = self.repeat(&format!("limits: {}", scenario.name), || {
                let costs = baker.limit_costs(&edits, folder)?;
                for _ in &edits {
                    baker.undo()?;
                }
                baker.step(Limit::Converged)?;
                Ok(costs)
            })?;
            self.limits_of(&scenario.name, &runs);
        }
        Ok(())
    }

    fn limits_of(&mut self, name: &str, runs: &[LimitCosts]) {
        let figures = &mut self.out.figures;
        let mut count = |what: &str, value: u64| {
            figures.push(Figure::count(format!("{name}: {what}"), value as f64));
        };
        count("lights that stay", runs[0].lights);
        count("lights with other shadows", runs[0].touched);
        // An edit that only changes lights leaves nothing to limit.
        if runs[0].touched == 0 {
            return;
        }
        let mut of = |what: &str, unit: &str, better, value: &dyn Fn(&LimitCosts, usize) -> f64| {
            let values = runs.iter().flat_map(|r| [0, 1].map(|i| value(r, i)));
            figures.push(Figure::new(format!("{name}: {what}"), unit, better, values));
        };
        of("limited updates", "ms", Better::Lower, &|r, i| {
            r.limited[i].wall
        });
        of("whole updates", "ms", Better::Neither, &|r, i| {
            r.whole[i].wall
        });
        of("limited updates, device", "ms", Better::Lower, &|r, i| {
            r.limited[i].device
        });
        of("whole updates, device", "ms", Better::Neither, &|r, i| {
            r.whole[i].device
        });
        of(
            "limited updates are cheaper",
            "x",
            Better::Higher,
            &|r, i| r.whole[1 - i].wall / r.limited[i].wall,
        );
    }
}

/// The edits of a script that has nothing else but waits.
fn edits(scenario: &Scenario) -> Option<Vec<Edit>> {
    let commands = scenario.script.iter().map(|(_, c)| c);
    commands
        .filter(|c| !matches!(c, Command::Wait(_)))
        .map(|c| match c {
            Command::Edit(edit) => Some(edit.clone()),
            _ => None,
        })
        .collect()
}
