//! What depth maps cost: hemicubes seen from random points inside the scene, in batches as a bake draws them.
//!
//! `cargo bench --bench shadow -- [SCENE.gltf [VIEWS [SIZE...]]]`; without a scene, the built-in Cornell box.

use rebake::bake::ShadowBench;
use rebake::gpu::{Gpu, GpuOptions};
use rebake::scene::Scene;

fn main() {
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let scene = match args.first() {
        Some(path) => Scene::load(path.as_ref()).expect("a readable scene").0,
        None => {
            Scene::from_document(&rebake::scene::builtin::builtin("cornell").expect("built in"))
                .expect("a scene")
        }
    };
    let numbers: Vec<u32> = args.iter().skip(1).flat_map(|a| a.parse()).collect();
    let views = numbers.first().copied().unwrap_or(64);
    let sizes = match numbers.get(1..) {
        Some(sizes) if !sizes.is_empty() => sizes.to_vec(),
        _ => vec![64, 128, 256, 512],
    };
    let gpu = Gpu::new(&GpuOptions::default()).expect("a Vulkan device");
    let bench = ShadowBench::new(&gpu, &scene).expect("buffers");
    println!(
        "{}: {} triangles, {} ({})",
        args.first().map_or("cornell", |a| a),
        bench.triangles(),
        gpu.info().name,
        gpu.info().driver
    );
    println!("{views} hemicubes a size, the first batch not counted; milliseconds per hemicube");
    println!("{:>6} {:>8} {:>8}  passes", "size", "wall", "CPU");
    for size in sizes {
        let cost = bench.run(size, views).expect("drawing");
        let ms = |seconds: f64| 1e3 * seconds / f64::from(views);
        print!("{size:>6} {:>8.2} {:>8.2} ", ms(cost.wall), ms(cost.cpu));
        for (name, seconds) in cost.passes {
            print!(" {name} {:.2}", ms(seconds));
        }
        println!("  sum {:016x}", cost.checksum);
    }
}
