//! Denoisers of one-sample pictures: planes in, planes out. Nothing here knows a scene.
//!
//! Every filter is a function from named planes and a small parameter struct to named planes. What lives
//! from frame to frame is in the filter's own history, and a history is never a plane that is handed out.

#![forbid(unsafe_code)]

mod error;
mod guides;

pub use error::{DenoiseError, Result};
pub use guides::Guides;
