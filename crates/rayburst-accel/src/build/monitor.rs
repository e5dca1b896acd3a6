//! Progress of a build and its cancelling, seen from the builders.

use crate::{BuildControl, BuildError};

/// Whom a build tells how far it is, if anyone.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Monitor<'a> {
    control: Option<&'a BuildControl>,
    is_silent: bool,
}

impl<'a> Monitor<'a> {
    /// Starts to report the build of a tree over some primitives.
    pub(crate) fn new(control: Option<&'a BuildControl>) -> Self {
        Self { control, is_silent: false }
    }

    /// Says over how many primitives the tree is.
    pub(crate) fn begin(&self, primitives: usize) {
        if let Some(control) = self.control {
            control.begin(primitives);
        }
    }

    /// Adds primitives whose subtree is built.
    pub(crate) fn advance(&self, primitives: usize) {
        if let Some(control) = self.control.filter(|_| !self.is_silent) {
            control.advance(primitives);
        }
    }

    /// All is done.
    pub(crate) fn finish(&self) {
        if let Some(control) = self.control {
            control.finish();
        }
    }

    /// Whether to give up. What is made after that is not looked at.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.control.is_some_and(BuildControl::is_cancelled)
    }

    /// The same without progress.
    pub(crate) fn silent(&self) -> Self {
        Self { is_silent: true, ..*self }
    }

    /// Fails once the build is cancelled.
    pub(crate) fn check(&self) -> Result<(), BuildError> {
        if self.is_cancelled() { Err(BuildError::Cancelled) } else { Ok(()) }
    }
}
