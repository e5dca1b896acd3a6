//! The tutorial's programs as modules.
#![allow(dead_code, reason = "their `main` is not called")]
#![allow(clippy::duplicate_mod, reason = "each brings what they share")]

#[path = "../../examples/adaptive.rs"]
pub(crate) mod adaptive;
#[path = "../../examples/animated_instances.rs"]
pub(crate) mod animated_instances;
#[path = "../../examples/callables.rs"]
pub(crate) mod callables;
#[path = "../../examples/cutouts.rs"]
pub(crate) mod cutouts;
#[path = "../../examples/hello_triangle.rs"]
pub(crate) mod hello_triangle;
#[path = "../../examples/path_tracer.rs"]
pub(crate) mod path_tracer;
#[path = "../../examples/procedural_gallery.rs"]
pub(crate) mod procedural_gallery;
#[path = "../../examples/transparency.rs"]
pub(crate) mod transparency;
#[path = "../../examples/whitted.rs"]
pub(crate) mod whitted;
