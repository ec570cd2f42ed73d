//! `rebake compare`.

use rebake::lightmap::compare;

use super::args;

pub fn run(args: &args::Args, command: &args::Compare) -> anyhow::Result<()> {
    let comparison = compare::compare(&command.a, &command.b)?;
    if let Some(path) = &command.output {
        comparison.write_false_colour(path)?;
    }
    if args.json {
        println!("{}", serde_json::to_string(&comparison.summary)?);
    } else if !args.quiet {
        println!("{}", comparison.summary);
    }
    Ok(())
}
