//! scratch
use rebake::{lightmap::*, scene::Scene};
use std::time::Instant;
fn main() {
    tracing_subscriber::fmt()
        .with_max_level(tracing::Level::INFO)
        .with_writer(std::io::stderr)
        .init();
    let a: Vec<String> = std::env::args().collect();
    let t = Instant::now();
    let (scene, _) = Scene::load(a[1].as_ref()).unwrap();
    println!("load {:?}", t.elapsed());
    let o = AtlasOptions {
        texels: a.get(2).map(|v| v.parse().unwrap()).unwrap_or(1_000_000),
        ..Default::default()
    };
    let t = Instant::now();
    let atlas = Atlas::build(&scene, &o).unwrap();
    println!(
        "atlas {:?} density {} page {} x {}",
        t.elapsed(),
        atlas.density,
        atlas.page_size,
        atlas.pages
    );
    let rect: u64 = atlas
        .objects
        .iter()
        .map(|o| o.size.x as u64 * o.size.y as u64)
        .sum();
    let t = Instant::now();
    let fetched: usize = atlas
        .objects
        .iter()
        .map(|o| {
            coverage::fetched(&o.layout, o.size)
                .iter()
                .filter(|f| **f)
                .count()
        })
        .sum();
    println!(
        "rect {rect} fetched {fetched} {:?} authored {} charts {}",
        t.elapsed(),
        atlas
            .objects
            .iter()
            .filter(|o| o.source == UvSource::Authored)
            .count(),
        atlas
            .objects
            .iter()
            .map(|o| o.layout.charts.iter().max().map_or(0, |m| m + 1))
            .sum::<u32>()
    );
}
