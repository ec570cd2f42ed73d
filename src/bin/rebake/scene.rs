//! `rebake scene`.

use anyhow::Context as _;
use rebake::scene::builtin::builtin;

use super::args;
use super::console::print;

pub fn run(args: &args::Args, command: &args::Scene) -> anyhow::Result<()> {
    let document = builtin(&command.name)?;
    document
        .write(&command.output)
        .with_context(|| format!("writing {}", command.output.display()))?;
    if !args.quiet {
        print(format_args!("{}", command.output.display()))?;
    }
    Ok(())
}
