use rayburst_accel::{Blas, BuildOptions, BuildQuality, TriangleMesh};
use rayburst_bench::FlatMesh;
use rayburst_scene::{builtin, import};
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    for name in &args {
        let scene = if name.contains('/') {
            import::load(std::path::Path::new(name), &import::LoadOptions::default()).unwrap()
        } else {
            builtin::build(name).unwrap()
        };
        let mesh = FlatMesh::new(&scene).unwrap();
        let n = mesh.indices.len() as f64;
        let short = name.rsplit('/').next().unwrap();
        for quality in [BuildQuality::Balanced, BuildQuality::Fast] {
            let triangles = [TriangleMesh::new(&mesh.positions, &mesh.indices)];
            let options = BuildOptions { quality, ..BuildOptions::default() };
            let mut blas = Blas::build(&triangles, &options).unwrap();
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut times = vec![];
                let begin = Instant::now();
                while begin.elapsed().as_secs_f64() < 1.0 || times.len() < 8 {
                    let b = Instant::now();
                    pool.install(|| blas.refit(&triangles)).unwrap();
                    times.push(b.elapsed().as_secs_f64());
                }
                times.sort_by(f64::total_cmp);
                println!(
                    "{short:20} {quality:?} threads {threads}: median {:.2} best {:.2} Mtri/s",
                if std::env::var("CHANGED").is_ok() {
                for part in [0.001, 0.01, 0.05, 0.2] {
                    let every = (1.0 / part) as usize;
                    let n = mesh.indices.len() / every;
                    // A patch of consecutive triangles, and triangles all over.
                    for (what, changed) in [("patch", (0..n).map(|i| (0, i as u32)).collect::<Vec<_>>()), ("all over", (0..n).map(|i| (0, (i * every) as u32)).collect())] {
                    let mut times = vec![];
                    blas.refit_changed(&triangles, &changed).unwrap();
                    for _ in 0..20 {
                        let b = Instant::now();
                        pool.install(|| blas.refit_changed(&triangles, &changed)).unwrap();
                        times.push(b.elapsed().as_secs_f64());
                    }
                    times.sort_by(f64::total_cmp);
                    println!("   changed {part} {what}: median {:.3} ms best {:.3} ms", times[10] * 1e3, times[0] * 1e3);
                    }
                }
                }
                    n / times[times.len() / 2] / 1e6,
                    n / times[0] / 1e6
                );
            }
        }
    }
}
