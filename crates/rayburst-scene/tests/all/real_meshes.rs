//! Every OBJ and PLY file of the shared scenes, with the triangle counts that its source states.

use std::{path::PathBuf, time::Instant};

use rayburst_scene::{
    AlphaMode, Scene, ShadingModel,
    import::{LoadOptions, load},
};

fn scene_path(name: &str) -> Option<PathBuf> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let path = PathBuf::from(root).join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

fn load_scene(name: &str) -> Option<Scene> {
    let path = scene_path(name)?;
    let start = Instant::now();
    let scene = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    eprintln!(
        "{name}: {} triangles, {} materials, {} images, {:?}, {:?}",
        scene.placed_triangles(),
        scene.materials.len(),
        scene.images.len(),
        start.elapsed(),
        scene.warnings
    );
    assert_valid(&scene);
    Some(scene)
}

/// What every importer promises.
pub(crate) fn assert_valid(scene: &Scene) {
    assert_eq!(scene.materials.len(), scene.material_names.len());
    for primitive in scene.meshes.iter().flat_map(|m| &m.primitives) {
        let vertices = primitive.positions.len();
        assert!(primitive.positions.iter().all(|p| p.is_finite()));
        assert!(primitive.indices.iter().flatten().all(|&i| (i as usize) < vertices));
        assert!((primitive.material as usize) < scene.materials.len());
        if let Some(normals) = &primitive.normals {
            assert_eq!(normals.len(), vertices);
            assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3));
        }
        for uvs in &primitive.uvs {
            assert_eq!(uvs.len(), vertices);
            assert!(uvs.iter().all(|uv| uv.is_finite()));
        }
        assert!(primitive.colors.as_ref().is_none_or(|c| c.len() == vertices));
    }
    for material in &scene.materials {
        for slot in material.slots() {
            assert!(slot.index().is_none_or(|t| t < scene.textures.len()));
        }
        assert!(material.base_color.iter().chain(&material.emissive).all(|x| x.is_finite()));
        assert!(material.ior >= 1.0 && (0.0..=1.0).contains(&material.roughness));
    }
    for texture in &scene.textures {
        assert!((texture.image as usize) < scene.images.len());
    }
}

#[test]
fn meshes_have_the_triangles_that_their_sources_state() {
    for (name, triangles) in [
        ("conference/conference.obj", 331_179),
        ("lost_empire/lost_empire.obj", 224_998),
        ("scrub_pine/scrubPine.obj", 527),
        ("stanford_dragon/dragon_vrip.ply", 871_414),
        ("armadillo/Armadillo.ply", 345_944),
        ("bunny/bun_zipper.ply", 69_451),
        ("cornell_box/CornellBox-Original.obj", 36),
        ("cornell_box/CornellBox-Mirror.obj", 36),
        ("cornell_box/CornellBox-Empty-CO.obj", 12),
        ("cornell_box/CornellBox-Empty-RG.obj", 12),
        ("cornell_box/CornellBox-Empty-White.obj", 12),
        ("cornell_box/CornellBox-Empty-Squashed.obj", 12),
        ("cornell_box/CornellBox-Glossy.obj", 1_112),
        ("cornell_box/CornellBox-Glossy-Floor.obj", 1_112),
        ("cornell_box/CornellBox-Sphere.obj", 2_188),
        ("cornell_box/CornellBox-Water.obj", 7_088),
        ("cornell_box/water.obj", 4_900),
    ] {
        let Some(scene) = load_scene(name) else { continue };
        assert_eq!(scene.placed_triangles(), triangles, "{name}");
    }
}

#[test]
fn lost_empire_has_cut_out_leaves_and_clear_water() {
    let Some(scene) = load_scene("lost_empire/lost_empire.obj") else { return };
    let material = |name: &str| {
        let at = scene.material_names.iter().position(|n| n == name).expect(name);
        scene.materials[at]
    };
    let leaves = material("Leaves");
    assert_eq!(leaves.alpha_mode(), AlphaMode::Mask);
    // The colour's own alpha channel holds what map_d holds.
    assert!(leaves.alpha_texture.index().is_none() && leaves.base_color_texture.index().is_some());
    assert_eq!(material("Stationary_Water").alpha_mode(), AlphaMode::Blend);
    assert_eq!(material("Stone").alpha_mode(), AlphaMode::Opaque);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn scrub_pine_needles_are_cut_out() {
    let Some(scene) = load_scene("scrub_pine/scrubPine.obj") else { return };
    let modes: Vec<AlphaMode> = scene.materials.iter().map(|m| m.alpha_mode()).collect();
    assert!(modes.contains(&AlphaMode::Mask) && modes.contains(&AlphaMode::Opaque), "{modes:?}");
}

#[test]
fn cornell_spheres_are_mirror_and_glass() {
    let Some(scene) = load_scene("cornell_box/CornellBox-Sphere.obj") else { return };
    let material = |name: &str| {
        let at = scene.material_names.iter().position(|n| n == name).expect(name);
        scene.materials[at]
    };
    assert_eq!(material("leftSphere").model(), ShadingModel::Mirror);
    let glass = material("rightSphere");
    assert_eq!(
        (glass.model(), glass.ior, glass.base_color),
        (ShadingModel::Dielectric, 2.5, [1.0; 4])
    );
    assert_eq!(material("light").emissive, [10.0; 3]);
    assert_eq!(material("floor").ior, 1.0);
    assert!(scene.has_light());
}
