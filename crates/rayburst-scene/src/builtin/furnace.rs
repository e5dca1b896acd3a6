//! A sphere that absorbs nothing in an environment that is the same everywhere: a correct renderer
//! shows nothing at all (the "white furnace"; Heitz: "Understanding the Masking-Shadowing Function
//! in Microfacet-Based BRDFs", JCGT 2014, section 5).

use glam::Vec3;

use super::{Parameter, ParameterKind, Values, new_scene, view::view};
use crate::{Environment, Material, Scene, ShadingModel, shapes};

pub(super) const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "material",
        meaning: "what the sphere is made of; its albedo is 1",
        kind: ParameterKind::Choice(&["diffuse", "metal", "plastic", "glass", "mirror"]),
    },
    Parameter {
        name: "roughness",
        meaning: "roughness of metal and plastic",
        kind: ParameterKind::Number { default: 0.5, min: 0.0, max: 1.0 },
    },
];

pub(super) fn build(values: &Values) -> Scene {
    let mut scene = new_scene("furnace");
    scene.environment = Some(Environment::Constant(Vec3::ONE));
    let roughness = values.get("roughness") as f32;
    let material = match values.word("material") {
        "metal" => Material::metal(Vec3::ONE, roughness),
        "plastic" => Material::plastic(Vec3::ONE, roughness),
        "glass" => Material::glass(1.5),
        "mirror" => Material::mirror(Vec3::ONE),
        _ => Material::diffuse(Vec3::ONE),
    };
    let closed = material.model() == ShadingModel::Dielectric;
    let material = scene.add_material(values.word("material"), material);
    // Refraction shows facets most.
    let levels = if closed { 6 } else { 5 };
    let sphere = shapes::sphere(Vec3::ZERO, 1.0, levels).into_primitive(material);
    scene.add_mesh("sphere", vec![sphere]);
    scene.views.push(view("front", Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 30.0));
    scene
}
