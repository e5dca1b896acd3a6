//! Wrong command lines: exit code 2, one clear line, and the way out.

use crate::program::{Place, Ran, command};

const VERBS: [&str; 13] = [
    "render",
    "info",
    "scenes",
    "compare",
    "figure",
    "inspect",
    "bench",
    "bench rays",
    "bench build",
    "bench update",
    "bench pipeline",
    "bench frame",
    "completions",
];

#[test]
fn every_verb_has_help_with_an_example() {
    let place = Place::new();
    for verb in VERBS {
        let ran = place.good(&format!("{verb} --help"));
        assert!(ran.stdout.contains("Example"), "{verb}: {}", ran.stdout);
        assert!(ran.stdout.contains("rayburst "), "{verb}");
        assert!(ran.stderr.is_empty(), "{verb}: {}", ran.stderr);
    }
    assert!(place.good("--help").stdout.contains("rayburst render"));
    assert!(place.good("--version").stdout.starts_with("rayburst "));
}

#[test]
fn options_that_do_not_exist_yet_are_unknown() {
    let place = Place::new();
    for option in ["--structure bvh8", "--mode auto", "--device gpu"] {
        place.bad(2, &format!("render {option}"));
    }
    place.bad(2, "view");
    place.bad(2, "denoise in.exr -o out.exr");
}

#[test]
fn unknown_names_list_the_known_ones_and_the_nearest() {
    let place = Place::new();
    for (line, words) in [
        ("rendr", vec!["render"]),
        ("render cornel", vec!["'cornell'", "veach-mis"]),
        ("render --integrator pth", vec!["path", "possible values"]),
        ("render --sampler sobl", vec!["sobol"]),
        ("render --filter guassian", vec!["gaussian"]),
        ("render --tone-map acess", vec!["aces"]),
        ("render --isa avx3", vec!["avx3", "scalar"]),
        ("render --aov albdeo -o a.exr", vec!["albedo", "normal"]),
        ("render --camera frnt --size 4x4", vec!["'front'"]),
        ("render --animation walk --size 4x4", vec!["no animation"]),
        ("figure 26.99", vec!["26.4"]),
        ("completions bsh", vec!["bash"]),
        ("compare a.png b.png --metric flp", vec!["flip", "ssim"]),
        ("bench rays --peer embre=x", vec!["embree"]),
        ("bench rays --sets primry", vec!["primary"]),
        ("bench rays --engines raybrst", vec!["rayburst:fast:auto", "embree:medium:1", "coherent"]),
        ("bench rays --engines embree:best:1", vec!["embree:low|medium|high"]),
        ("bench rays --engines embree:high:16", vec!["embree:high:16", "--peer embree="]),
        ("bench rays --preset balancd", vec!["'balanced'", "fast"]),
        ("bench rays --mode calls", vec!["'call'", "auto"]),
        ("bench build --preset slow", vec!["fast, balanced"]),
        ("bench update --cases twst", vec!["'twist'", "particles"]),
        ("furnace:rough=1", vec![]),
    ] {
        let ran = place.run(line);
        assert_eq!(ran.code, Some(2), "{line}: {ran:?}");
        ran.complaint(line);
        for word in words {
            assert!(ran.stderr.contains(word), "{line}: '{word}' is not in {}", ran.stderr);
        }
    }
    assert!(place.files().is_empty());
}

#[test]
fn values_out_of_range_are_refused() {
    let place = Place::new();
    for line in [
        "",
        "render --size 0x0",
        "render --size 100000x100000",
        "render --size 99999999999999999999x2",
        "render --size 64",
        "render --spp 0",
        "render --spp -3",
        "render --spp 99999999999",
        "render --max-depth 0",
        "render --threads 0",
        "render --threads 99999",
        "render --eye 1,2",
        "render --eye nan,0,0",
        "render --eye 0,0,0 --target 0,0,0 --size 4x4",
        "render --up 0,0,0 --size 4x4",
        "render --fov 0",
        "render --fov 180",
        "render --aperture -1",
        "render --focus 0",
        "render --exposure bright",
        "render --exposure inf",
        "render --time nan",
        "render --budget 0",
        "render --budget -1",
        "render --noise 0",
        "render --frames 3..1 -o a.{frame}.png",
        "render --frames 0..3",
        "render --frames 0..3 --time 1 -o a.{frame}.png",
        "render --fps 24",
        "render --fps 0 --frames 0..1 -o a.gif",
        "render -o a.{frame}.png",
        "render -o film.gif",
        "render -o picture",
        "render -o picture.jpg",
        "render --aov albedo",
        "render --aov albedo -o a.hdr",
        "render --resume",
        "render --resume --frames 0..1 -o a.gif",
        "render --environment-rotation 10 --size 4x4",
        "info",
        "compare a.png",
        "compare a.png b.png --heatmap map.exr",
        "inspect cornell",
        "inspect cornell --pixel 3",
        "inspect cornell --pixel 512,0",
        "figure",
        "figure 26.4 -o f.exr",
        "bench",
        "bench rays --repeat 0",
        "bench rays --engines ,",
        "bench rays --plot rays.jpg",
        "bench build --repeat 0",
        "bench build --seconds 0",
        "bench build --threads 0",
        "bench build --plot build.exr",
        "bench update --scale 0",
        "bench update --scale 11",
        "bench update --repeat 0",
        "completions",
    ] {
        let ran = place.run(line);
        assert_eq!(ran.code, Some(2), "'{line}': {ran:?}");
        if !line.is_empty() && !matches!(line, "bench") {
            ran.complaint(line);
        }
    }
    assert!(place.files().is_empty());
    let too_large = place.bad(2, "render --size 100000x100000");
    assert!(too_large.contains("the limit is"), "{too_large}");
}

#[test]
fn the_environment_can_name_an_instruction_set() {
    let place = Place::new();
    let line = ["render", "cornell", "--size", "8x8", "--spp", "1", "-o"];
    let with = |isa: &str, out: &str| {
        Ran::new(command(place.folder()).env("RAYBURST_ISA", isa).args(line).arg(out).output())
    };
    assert_eq!(with("scalar", "a.png").code, Some(0));
    let wrong = with("sse9", "b.png");
    assert_eq!(wrong.code, Some(1), "{wrong:?}");
    assert!(wrong.complaint("sse9").contains("scalar"));
}
