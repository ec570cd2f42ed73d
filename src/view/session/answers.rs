//! What the person asks of the bake: edits, undo and redo, and what else there are buttons for.

use tracing::debug_span;

use super::{Note, Request, Session, ViewError};
use crate::bake::BakeError;
use crate::scene::edit::{Command, Edit};

impl Session<'_> {
    pub(super) fn answer(&mut self, request: Request) -> Result<(), ViewError> {
        let _span = debug_span!("answer").entered();
        match request {
            Request::Command(command) => self.command(command)?,
            Request::Pause(paused) => {
                self.paused = paused;
                // No update stays halfway.
                self.baker.finish()?;
            }
            Request::Step => self.single += 1,
            Request::StartOver(compare) => {
                if compare {
                    self.compare = Some(self.baker.lightmap()?);
                }
                self.baker.start_over()?;
                self.stale = true;
                self.marked();
            }
            Request::Slice(slice) => self.slice = Some(slice),
            Request::SaveBake(_) | Request::SaveHistory(_) | Request::SaveScene(_) => {
                self.save(request);
            }
            Request::Overlays(overlays) => {
                self.overlays = overlays;
                self.sketch()?;
            }
            // The window's state says so already; these end `work`.
            Request::Live(_) | Request::Close | Request::Reload | Request::Drag(..) => {}
        }
        self.publish();
        Ok(())
    }

    fn command(&mut self, command: Command) -> Result<(), ViewError> {
        self.dragging = false;
        let done = match &command {
            Command::Edit(edit) => self.baker.apply(edit, &self.setup.folder),
            Command::Undo => self.baker.undo(),
            Command::Redo => self.baker.redo(),
            Command::Wait(_) => Ok(()),
        };
        if self.accepted(done)? {
            self.log.push(command);
            self.changed()?;
        }
        Ok(())
    }

    pub(super) fn drag(&mut self, edit: Edit, first: bool) -> Result<(), ViewError> {
        let _span = debug_span!("drag").entered();
        // A field may tell a number that was typed once more when it is left: that is nothing to undo.
        if matches!(self.log.last(), Some(Command::Edit(last)) if *last == edit) {
            return Ok(());
        }
        let done = if first {
            self.baker.apply(&edit, &self.setup.folder)
        } else {
            self.baker.amend(&edit, &self.setup.folder)
        };
        if self.accepted(done)? {
            if !first {
                self.log.pop();
            }
            self.log.push(Command::Edit(edit));
            self.dragging = true;
            self.changed()?;
        }
        Ok(())
    }

    /// What was refused is told; what broke ends the session.
    fn accepted(&self, done: Result<(), BakeError>) -> Result<bool, ViewError> {
        match done {
            Ok(()) => Ok(true),
            Err(error @ (BakeError::Edit(_) | BakeError::Lightmap(_))) => {
                self.tell(Note::failed(error.to_string()));
                Ok(false)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn changed(&mut self) -> Result<(), ViewError> {
        self.marked();
        self.stale = true;
        self.show()?;
        self.sketch()
    }

    fn marked(&mut self) {
        let seconds = self.start.elapsed().as_secs_f64();
        self.status.edits.push(seconds);
        // Until then it was right.
        let before = self.status.curve.last().map(|last| [seconds, last[1]]);
        self.status.curve.extend(before);
    }
}
