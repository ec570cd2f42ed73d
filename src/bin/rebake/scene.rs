//! `rebake scene`.

use anyhow::Context as _;
use rebake::scene::builtin::builtin;

use super::args;

pub fn run(args: &args::Args, command: &args::Scene) -> anyhow::Result<()> {
    let document = builtin(&command.name)?;
    document
        .write(&command.output)
        .with_context(|| format!("writing {}", command.output.display()))?;
    if !args.quiet {
        println!("{}", command.output.display());
    }
    Ok(())
}
