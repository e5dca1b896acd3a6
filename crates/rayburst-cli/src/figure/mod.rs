//! `rayburst figure`: what a figure of the chapter shows, from our own scenes and rays, with the
//! property that it demonstrates as a number.

mod camera_frame;
pub(crate) mod canvas;
mod coherent_rays;
mod depth_of_field;
mod ray_interval;
mod ray_tree;
mod refraction_tree;
mod rendering;
mod sample_series;
mod secondary_rays;
mod slice;
mod symbols;
mod texture_filtering;
mod trace_and_shade;
mod two_levels;
mod two_paths;

use std::path::PathBuf;

use rayburst::image::{Rgb8Image, write_png};

use crate::{
    args::verbs::FigureArgs,
    error::{CliError, Result},
    machine,
    output::{self, Format},
    terminal,
};

/// A figure that can be made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figure {
    number: &'static str,
    shows: &'static str,
    draw: fn() -> Result<Drawing>,
}

/// A finished figure.
pub(crate) struct Drawing {
    picture: Rgb8Image,
    /// What the figure demonstrates: names and values for stdout.
    numbers: Vec<(&'static str, String)>,
}

const fn figure(
    number: &'static str,
    shows: &'static str,
    draw: fn() -> Result<Drawing>,
) -> (&'static str, Figure) {
    (number, Figure { number, shows, draw })
}

/// All figures by number.
pub(crate) const FIGURES: &[(&str, Figure)] = &[
    figure("26.2", "the camera and the ray through a pixel", camera_frame::draw),
    figure("26.3", "trace() and shade() call each other", trace_and_shade::draw),
    figure("26.4", "reflection and refraction rays", refraction_tree::draw),
    figure("26.5", "two paths of one pixel", two_paths::draw),
    figure("26.6", "the same picture with 1 to 65,536 samples a pixel", sample_series::draw),
    figure("26.7", "the interval of a ray, and hits in it", ray_interval::draw),
    figure("26.8", "instances that share a bottom level", two_levels::draw),
    figure("26.16", "secondary rays that stay together and that do not", coherent_rays::draw),
    figure("26.23", "textures by mip 0, ray cones and ray differentials", texture_filtering::draw),
    figure("26.24", "depth of field by a thin lens", depth_of_field::draw),
];

/// The end of the verb's help: what there is.
pub(crate) fn help() -> String {
    let lines: Vec<String> =
        FIGURES.iter().map(|(_, f)| format!("  {:6} {}", f.number, f.shows)).collect();
    let figures = lines.join("\n");
    format!("Figures:\n{figures}\n\nExample:\n  rayburst figure 26.4 -o refraction.png")
}

/// Draws a figure and prints its numbers.
pub(crate) fn run(args: &FigureArgs) -> Result<()> {
    let default = || PathBuf::from(format!("figure-{}.png", args.figure.number));
    let path = args.output.clone().unwrap_or_else(default);
    if Format::of(&path)? != Format::Png {
        return Err(CliError::usage(format!("figures are .png, not {}", path.display())));
    }
    output::check_writable(&path)?;
    machine::start(args.threads)?;
    let drawing = (args.figure.draw)()?;
    write_png(&path, &drawing.picture)?;
    terminal::say(format!("{}: figure {}", path.display(), args.figure.number));
    let width = drawing.numbers.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0);
    for (name, value) in &drawing.numbers {
        terminal::result(format!("{name:width$}  {value}"))?;
    }
    Ok(())
}
