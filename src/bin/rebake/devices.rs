//! `rebake devices`.

use rebake::gpu;
use serde_json::json;

use super::args::Args;
use super::console::print;

pub fn run(args: &Args) -> anyhow::Result<()> {
    let devices = gpu::devices()?;
    if devices.is_empty() {
        return Err(gpu::GpuError::NoDevice("was found".into()).into());
    }
    for d in devices {
        if args.json {
            print(format_args!(
                "{}",
                json!({ "index": d.index, "name": d.name, "kind": d.kind, "driver": d.driver, "memory": d.memory, "lacks": d.missing })
            ))?;
        } else {
            let verdict = if d.missing.is_empty() {
                "ready".to_owned()
            } else {
                format!("lacks {}", d.missing.join(", "))
            };
            print(format_args!(
                "{}: {} ({}), {}, {:.1} GiB, {verdict}",
                d.index,
                d.name,
                d.kind,
                d.driver,
                d.memory as f64 / (1u64 << 30) as f64
            ))?;
        }
    }
    Ok(())
}
