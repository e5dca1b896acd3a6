//! Frames in real time.

mod screen;
mod ssao;
mod ssr;

pub use ssao::{ScreenOcclusion, screen_occlusion};
pub use ssr::{
    ScreenReflections, ScreenReflectionsInput, ScreenReflectionsSettings, screen_reflections,
};
