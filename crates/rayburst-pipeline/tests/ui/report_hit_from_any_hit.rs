use rayburst_pipeline::HitGroup;

fn main() {
    HitGroup::<u32, _, ()>::triangles("triangles").any_hit(|hit, _| {
        hit.report_hit(1.0, 0, hit.attributes());
        hit.accept_hit()
    });
}
