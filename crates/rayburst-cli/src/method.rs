//! How a picture comes about: by samples that add up, or by frames in real time.

use rayburst::render::{Display, IntegratorKind, realtime::FrameMode};

/// What `--integrator` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// Samples of an integrator, pass by pass.
    Progressive(IntegratorKind),
    /// Frames of a renderer that keeps a history.
    Frames(FrameMode),
}

/// How many there are.
const COUNT: usize = IntegratorKind::ALL.len() + FrameMode::ALL.len();

impl Method {
    /// All of them with the names that users type.
    pub(crate) const ALL: [(&'static str, Self); COUNT] = {
        let mut all = [("", Self::Progressive(IntegratorKind::Path)); COUNT];
        let mut at = 0;
        while at < COUNT {
            all[at] = if at < IntegratorKind::ALL.len() {
                let (name, kind) = IntegratorKind::ALL[at];
                (name, Self::Progressive(kind))
            } else {
                let (name, mode) = FrameMode::ALL[at - IntegratorKind::ALL.len()];
                (name, Self::Frames(mode))
            };
            at += 1;
        }
        all
    };

    /// The name that users type.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Progressive(kind) => kind.name(),
            Self::Frames(mode) => mode.name(),
        }
    }

    /// What its numbers mean to a screen.
    pub(crate) fn display(self) -> Display {
        match self {
            Self::Progressive(kind) => kind.display(),
            Self::Frames(_) => Display::Radiance,
        }
    }
}

impl Default for Method {
    fn default() -> Self {
        Self::Progressive(IntegratorKind::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_all_there() {
        let mut names: Vec<&str> = Method::ALL.iter().map(|(name, _)| *name).collect();
        assert!(Method::ALL.iter().all(|(name, method)| method.name() == *name));
        assert!(names.contains(&"path") && names.contains(&"hybrid"));
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), COUNT);
    }
}
