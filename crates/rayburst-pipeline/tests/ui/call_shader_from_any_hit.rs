use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let mut table = ShaderTable::new();
    let callable = table.callable(|_, _: &mut u32| {});
    let group = HitGroup::triangles("triangles").any_hit(move |hit, payload: &mut u32| {
        hit.call_shader(callable, payload);
        hit.accept_hit()
    });
    table.hit(&group, ());
}
