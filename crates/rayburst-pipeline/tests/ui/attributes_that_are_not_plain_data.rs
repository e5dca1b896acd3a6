use rayburst_pipeline::HitGroup;

fn main() {
    HitGroup::<u32, String>::procedural("boxes", |shader| {
        shader.report_hit(1.0, 0, String::new());
    });
}
