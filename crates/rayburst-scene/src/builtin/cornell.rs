//! The Cornell box, as measured.
//!
//! Geometry and spectra: "Cornell Box Data", Cornell University Program of Computer Graphics, 1998.
//! One unit of the data is one millimetre here: the box is 0.55 m wide, as the real one was. The
//! light's spectrum is measured in arbitrary units; its luminance is set to that of a bright lamp. The
//! lamp is very yellow; unless `light=measured`, it is shown as to an eye that has largely adapted to
//! it (von Kries' scaling, CIE 159:2004 with a degree of 0.75).
//! The ceiling has a hole where the light is, so that no surfaces coincide.

use glam::Vec3;

use super::{
    Parameter, ParameterKind, Values, new_scene,
    spectra::{self, Spectrum},
    view::view,
};
use crate::{Material, Scene, shapes::Shape};

const MILLIMETRE: f32 = 0.001;

/// Luminance of the light, cd/m².
const LUMINANCE: f32 = 10_000.0;

/// How far the eye adapts to the light's colour, 0…1.
const ADAPTATION: f32 = 0.75;

pub(super) const PARAMETERS: &[Parameter] = &[Parameter {
    name: "light",
    meaning: "the lamp's colour as seen by an adapted eye, or as measured",
    kind: ParameterKind::Choice(&["adapted", "measured"]),
}];

/// Emission of the light, relative, every 100 nm from 400 nm.
const EMISSION: Spectrum = Spectrum { first: 400.0, step: 100.0, values: &[0.0, 8.0, 15.6, 18.4] };

/// Reflectances every 4 nm from 400 nm.
const WHITE: Spectrum = measured(&[
    0.343, 0.445, 0.551, 0.624, 0.665, 0.687, 0.708, 0.723, 0.715, 0.710, 0.745, 0.758, 0.739,
    0.767, 0.777, 0.765, 0.751, 0.745, 0.748, 0.729, 0.745, 0.757, 0.753, 0.750, 0.746, 0.747,
    0.735, 0.732, 0.739, 0.734, 0.725, 0.721, 0.733, 0.725, 0.732, 0.743, 0.744, 0.748, 0.728,
    0.716, 0.733, 0.726, 0.713, 0.740, 0.754, 0.764, 0.752, 0.736, 0.734, 0.741, 0.740, 0.732,
    0.745, 0.755, 0.751, 0.744, 0.731, 0.733, 0.744, 0.731, 0.712, 0.708, 0.729, 0.730, 0.727,
    0.707, 0.703, 0.729, 0.750, 0.760, 0.751, 0.739, 0.724, 0.730, 0.740, 0.737,
]);
const GREEN: Spectrum = measured(&[
    0.092, 0.096, 0.098, 0.097, 0.098, 0.095, 0.095, 0.097, 0.095, 0.094, 0.097, 0.098, 0.096,
    0.101, 0.103, 0.104, 0.107, 0.109, 0.112, 0.115, 0.125, 0.140, 0.160, 0.187, 0.229, 0.285,
    0.343, 0.390, 0.435, 0.464, 0.472, 0.476, 0.481, 0.462, 0.447, 0.441, 0.426, 0.406, 0.373,
    0.347, 0.337, 0.314, 0.285, 0.277, 0.266, 0.250, 0.230, 0.207, 0.186, 0.171, 0.160, 0.148,
    0.141, 0.136, 0.130, 0.126, 0.123, 0.121, 0.122, 0.119, 0.114, 0.115, 0.117, 0.117, 0.118,
    0.120, 0.122, 0.128, 0.132, 0.139, 0.144, 0.146, 0.150, 0.152, 0.157, 0.159,
]);
const RED: Spectrum = measured(&[
    0.040, 0.046, 0.048, 0.053, 0.049, 0.050, 0.053, 0.055, 0.057, 0.056, 0.059, 0.057, 0.061,
    0.061, 0.060, 0.062, 0.062, 0.062, 0.061, 0.062, 0.060, 0.059, 0.057, 0.058, 0.058, 0.058,
    0.056, 0.055, 0.056, 0.059, 0.057, 0.055, 0.059, 0.059, 0.058, 0.059, 0.061, 0.061, 0.063,
    0.063, 0.067, 0.068, 0.072, 0.080, 0.090, 0.099, 0.124, 0.154, 0.192, 0.255, 0.287, 0.349,
    0.402, 0.443, 0.487, 0.513, 0.558, 0.584, 0.620, 0.606, 0.609, 0.651, 0.612, 0.610, 0.650,
    0.638, 0.627, 0.620, 0.630, 0.628, 0.642, 0.639, 0.657, 0.639, 0.635, 0.642,
]);

const fn measured(values: &'static [f64]) -> Spectrum {
    Spectrum { first: 400.0, step: 4.0, values }
}

/// A point of the data.
const fn at(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x * MILLIMETRE, y * MILLIMETRE, z * MILLIMETRE)
}

pub(super) fn build(values: &Values) -> Scene {
    let mut scene = new_scene("cornell");
    let mut paint = |name: &str, spectrum: &Spectrum| {
        scene.add_material(name, Material::diffuse(spectra::reflectance(spectrum, &EMISSION)))
    };
    let (white, red, green) = (paint("white", &WHITE), paint("red", &RED), paint("green", &GREEN));
    let mut color = spectra::light(&EMISSION);
    if values.word("light") == "adapted" {
        color = color.lerp(Vec3::ONE, ADAPTATION);
    }
    let light = scene.add_material(
        "light",
        // One-sided: nothing behind the ceiling is to be lit.
        Material { flags: 0, ..Material::emitter(color * LUMINANCE) },
    );

    let mut room = Shape::default();
    room.add_quad([
        at(552.8, 0.0, 0.0),
        at(0.0, 0.0, 0.0),
        at(0.0, 0.0, 559.2),
        at(549.6, 0.0, 559.2),
    ]);
    room.add_quad([
        at(549.6, 0.0, 559.2),
        at(0.0, 0.0, 559.2),
        at(0.0, 548.8, 559.2),
        at(556.0, 548.8, 559.2),
    ]);
    let lamp = [
        at(343.0, 548.8, 227.0),
        at(343.0, 548.8, 332.0),
        at(213.0, 548.8, 332.0),
        at(213.0, 548.8, 227.0),
    ];
    let ceiling = [
        at(556.0, 548.8, 0.0),
        at(556.0, 548.8, 559.2),
        at(0.0, 548.8, 559.2),
        at(0.0, 548.8, 0.0),
    ];
    for i in 0..4 {
        let j = (i + 1) % 4;
        room.add_quad([ceiling[i], ceiling[j], lamp[j], lamp[i]]);
    }
    scene.add_mesh("room", vec![room.into_primitive(white)]);
    let mut wall = |name: &str, corners: [Vec3; 4], material: u32| {
        let mut shape = Shape::default();
        shape.add_quad(corners);
        scene.add_mesh(name, vec![shape.into_primitive(material)]);
    };
    wall(
        "right wall",
        [at(0.0, 0.0, 559.2), at(0.0, 0.0, 0.0), at(0.0, 548.8, 0.0), at(0.0, 548.8, 559.2)],
        green,
    );
    wall(
        "left wall",
        [
            at(552.8, 0.0, 0.0),
            at(549.6, 0.0, 559.2),
            at(556.0, 548.8, 559.2),
            at(556.0, 548.8, 0.0),
        ],
        red,
    );
    wall("light", lamp, light);
    for (name, height, corners) in [
        ("short block", 165.0, [(130.0, 65.0), (82.0, 225.0), (240.0, 272.0), (290.0, 114.0)]),
        ("tall block", 330.0, [(423.0, 247.0), (265.0, 296.0), (314.0, 456.0), (472.0, 406.0)]),
    ] {
        let mut block = Shape::default();
        block.add_hexahedron(
            corners.map(|(x, z)| at(x, 0.0, z)),
            corners.map(|(x, z)| at(x, height, z)),
        );
        scene.add_mesh(name, vec![block.into_primitive(white)]);
    }

    // A lens of 35 mm before a film of 25 mm.
    let fov = 2.0 * (0.0125f32 / 0.035).atan();
    scene.views.push(view(
        "front",
        at(278.0, 273.0, -800.0),
        at(278.0, 273.0, 0.0),
        fov.to_degrees(),
    ));
    scene
}
