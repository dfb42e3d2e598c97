//! `sheetsplat completions` and `sheetsplat man`: documents generated from the program's arguments.

use clap::Command;
use clap_complete::Shell;

use crate::failure::Failure;
use crate::stdout::stdout;

#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  sheetsplat completions bash > ~/.local/share/bash-completion/completions/sheetsplat"
)]
pub(crate) struct Completions {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sheetsplat man orbit > ~/.local/share/man/man1/sheetsplat-orbit.1")]
pub(crate) struct Man {
    /// The subcommand; without it, the program's own page.
    command: Option<String>,
}

pub(crate) fn completions(arguments: &Completions, mut program: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    let name = program.get_name().to_owned();
    clap_complete::generate(arguments.shell, &mut program, name, &mut script);
    stdout(&script)
}

pub(crate) fn man(arguments: &Man, mut program: Command) -> Result<(), Failure> {
    // This gives subcommands the global options, and names such as sheetsplat-orbit.
    program.build();
    let command = match &arguments.command {
        None => program,
        Some(name) => program.find_subcommand(name).cloned().ok_or_else(|| {
            let allowed: Vec<&str> = program.get_subcommands().map(Command::get_name).collect();
            Failure::Input(format!("man: found {name}, allowed: {}", allowed.join(", ")))
        })?,
    };
    let mut page = Vec::new();
    let rendered = clap_mangen::Man::new(command).render(&mut page);
    rendered.map_err(|error| Failure::Other(error.to_string()))?;
    stdout(&page)
}
