//! The rasteriser against brute force, and the rules it promises.

mod brute;
mod robust;
mod rules;
mod views;
