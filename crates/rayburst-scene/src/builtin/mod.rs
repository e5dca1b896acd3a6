//! Scenes made in code: the pictures that need no file, and the benchmarks whose size is a
//! parameter. The same bytes on every machine and in every run.

mod checker;
mod city;
mod cornell;
mod dof;
mod furnace;
mod gradient;
mod hairball;
mod hemisphere_room;
mod outdoors;
mod spec;
mod spectra;
mod spheres;
mod stadium;
mod terrain;
mod veach_mis;
mod view;

pub use spec::{BuiltinError, Parameter, ParameterKind};

use spec::Values;

use crate::{Environment, Scene};

/// A built-in scene.
#[derive(Clone, Copy, Debug)]
pub struct BuiltinScene {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it shows, one line.
    pub summary: &'static str,
    /// The figure of "Real-Time Rendering", chapter 26, that it follows.
    pub figure: Option<&'static str>,
    /// What may follow the name, see [`build`].
    pub parameters: &'static [Parameter],
    /// Width and height of a picture of the shape that the first view is composed for.
    pub size: (u32, u32),
    build: fn(&Values) -> Scene,
}

/// The scene that is shown when none is named.
pub const DEFAULT: &str = "cornell";

/// All built-in scenes, the default one first.
pub fn list() -> &'static [BuiltinScene] {
    SCENES
}

/// Builds a scene from `NAME`, `NAME:VALUE` (of the first parameter) or `NAME:KEY=VALUE,…`.
pub fn build(spec: &str) -> Result<Scene, BuiltinError> {
    let (scene, values) = spec::parse(spec, SCENES)?;
    Ok((scene.build)(&values))
}

const SCENES: &[BuiltinScene] = &[
    BuiltinScene {
        name: "cornell",
        summary: "the Cornell box with its measured geometry and spectra",
        figure: Some("26.6"),
        parameters: cornell::PARAMETERS,
        size: (400, 400),
        build: cornell::build,
    },
    BuiltinScene {
        name: "spheres",
        summary: "Whitted's glass and mirror spheres above a checkerboard",
        figure: Some("26.4"),
        parameters: &[],
        size: (640, 480),
        build: spheres::build,
    },
    BuiltinScene {
        name: "hemisphere-room",
        summary: "a reflective hemisphere in a room of checkerboards",
        figure: Some("26.23"),
        parameters: &[],
        size: (640, 480),
        build: hemisphere_room::build,
    },
    BuiltinScene {
        name: "veach-mis",
        summary: "glossy plates under small and large lights: the test of multiple importance sampling",
        figure: None,
        parameters: &[],
        size: (768, 512),
        build: veach_mis::build,
    },
    BuiltinScene {
        name: "dof",
        summary: "a row of teapots before small lights, through a wide lens",
        figure: Some("26.24"),
        parameters: dof::PARAMETERS,
        size: (800, 500),
        build: dof::build,
    },
    BuiltinScene {
        name: "stadium",
        summary: "the Utah teapot in a stadium of seats",
        figure: None,
        parameters: stadium::PARAMETERS,
        size: (960, 540),
        build: stadium::build,
    },
    BuiltinScene {
        name: "terrain",
        summary: "mountains around a lake, of any number of triangles",
        figure: None,
        parameters: terrain::PARAMETERS,
        size: (960, 540),
        build: terrain::build,
    },
    BuiltinScene {
        name: "hairball",
        summary: "a ball of curly hair, of any number of triangles",
        figure: None,
        parameters: hairball::PARAMETERS,
        size: (512, 512),
        build: hairball::build,
    },
    BuiltinScene {
        name: "city",
        summary: "a city of boxes, of any number of triangles",
        figure: None,
        parameters: city::PARAMETERS,
        size: (960, 540),
        build: city::build,
    },
    BuiltinScene {
        name: "furnace",
        summary: "a sphere of albedo 1 in a white environment, which must vanish",
        figure: None,
        parameters: furnace::PARAMETERS,
        size: (256, 256),
        build: furnace::build,
    },
];

/// An empty scene in metres, dark until it says otherwise.
fn new_scene(name: &str) -> Scene {
    Scene {
        name: name.to_owned(),
        environment: Some(Environment::None),
        metres_per_unit: 1.0,
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests;
