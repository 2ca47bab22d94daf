//! Help texts that begin with examples, and suggestions for users who type a file name instead of a command.

use std::error::Error as _;
use std::ffi::OsString;
use std::io::Write as _;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, CommandFactory as _, FromArgMatches as _};

use crate::command::Cli;
use crate::common::refuse_dash;
use spikelane::error::printable;

/// Two examples of each command.
const COMMAND_EXAMPLES: &[(&str, [&str; 2])] = &[
    (
        "simulate",
        ["simulate lake.mp4 -o out/lake --clean", "simulate photo.png -o out/photo --readouts 4000"],
    ),
    (
        "live",
        [
            "live --builtin-light chart --readouts 2000 --sink pipe > chart.dat",
            "live photo.png --sink tcp:localhost:9000 --block",
        ],
    ),
    ("inspect", ["inspect out/lake.dat", "inspect camera.dat --width 400 --height 250 --png look.png"]),
    (
        "convert",
        ["convert out/lake.dat lake.npy", "convert in.dat part.dat --readouts 0..1000 --crop 100,50,64,64"],
    ),
    ("verify", ["verify out/lake.dat", "verify out/*.json"]),
    ("partials", ["partials out", "partials out --delete"]),
    (
        "reconstruct",
        [
            "reconstruct out/lake.dat -o lake.png",
            "reconstruct out/lake.dat -o lake.mp4 --method span --window 41",
        ],
    ),
    ("evaluate", ["evaluate out/lake.dat", "evaluate out/photo.dat --reference photo.png"]),
    ("view", ["view out/lake.dat", "view out/lake.dat --export lake.html --readouts 0..500"]),
    ("preset", ["preset list", "preset show physical > mine.toml"]),
    ("effects", ["effects", "effects prnu"]),
    ("measure", ["measure flat.dat", "measure flat.dat --report flat.html"]),
    (
        "calibrate",
        [
            "record physical -o set && spikelane calibrate set/recordings.toml",
            "calibrate mine/recordings.toml -o camera --light-uncertainty 0.02",
        ],
    ),
    ("compare", ["compare static.dat", "compare set/recordings.toml --camera physical --camera mine.toml"]),
    (
        "diagnose",
        ["diagnose first.toml --holdout second.toml", "diagnose first.toml --camera mine.toml -o found"],
    ),
    ("record", ["record physical -o set", "record --camera mine.toml --dry-run"]),
    (
        "check",
        [
            "check spikezoo photo.png --code ~/Spike-Zoo",
            "check scsim photo.png --code ~/SCSim --python venv/bin/python",
        ],
    ),
    ("scene", ["scene -o drive", "scene -o drive --scene-seed 3 --frames 100 --video"]),
    (
        "dataset",
        ["dataset -o first --scene-preset tiny", "dataset -o set --from clips --dataset-layout spike-zoo"],
    ),
    ("benchmark", ["benchmark generate quick -o quick", "benchmark run quick --baseline tfp -o runs/tfp"]),
    ("speed", ["speed", "speed --quick"]),
    ("completions", ["completions bash", "completions zsh"]),
    ("man", ["man | man -l -", "man --output man"]),
];

/// Order of the parts of the help: description, examples, usage, arguments.
const HELP_TEMPLATE: &str =
    "{about-with-newline}\n{before-help}{usage-heading} {usage}\n\n{all-args}{after-help}";

/// Returns the command line definition with the examples of all commands.
pub(crate) fn command() -> clap::Command {
    let shown = |examples: &[&str; 2]| {
        let line = |example: &&str| format!("  spikelane {example}").trim_end().to_owned();
        format!("Examples:\n{}", examples.iter().map(line).collect::<Vec<_>>().join("\n"))
    };
    let command = Cli::command()
        .help_template(HELP_TEMPLATE)
        .before_help(shown(&["", "simulate lake.mp4 -o out/lake"]));
    let command = accept_negative_numbers(refuse_dash(command));
    COMMAND_EXAMPLES.iter().fold(command, |command, (name, examples)| {
        command.mut_subcommand(name, |c| c.help_template(HELP_TEMPLATE).before_help(shown(examples)))
    })
}

/// Lets a negative number follow an option. The option then rejects the number with its range; clap would report an unexpected
/// argument instead.
fn accept_negative_numbers(command: clap::Command) -> clap::Command {
    let accept = |arg: Arg| {
        let takes_number = arg.get_action().takes_values() && !arg.is_positional();
        if takes_number { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(accept).mut_subcommands(accept_negative_numbers)
}

/// Parses a command line. The first argument is the program name.
///
/// # Errors
/// The exit code, if help was printed or if the arguments were rejected.
pub(crate) fn parse(args: &[OsString]) -> Result<Cli, u8> {
    let read = command().try_get_matches_from(args).and_then(|matches| Cli::from_arg_matches(&matches));
    read.map_err(|error| {
        // If a standard channel is closed, the failure cannot be reported.
        let _ =
            match (suggestion(&error).or_else(|| argument_message(&error, args)), error.render().to_string())
            {
                (Some(line), _) => writeln!(std::io::stderr(), "spikelane: {}", printable(&line)),
                // clap prints in color. A text with control characters is escaped and printed without color.
                (None, text) if printable(&text) == text => error.print(),
                (None, text) => write!(std::io::stderr(), "{}", printable(&text)),
            };
        u8::try_from(error.exit_code()).unwrap_or(2)
    })
}

/// Returns the correct command if the user typed a file name instead of a command.
fn suggestion(error: &clap::Error) -> Option<String> {
    if error.kind() != ErrorKind::InvalidSubcommand {
        return None;
    }
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return None };
    let path = Path::new(word);
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    if ending.is_none() && !path.exists() {
        return None;
    }
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let typed = match ending.as_deref() {
        Some("dat") => format!("spikelane inspect {word}"),
        Some("toml") => {
            format!("spikelane calibrate {word}' or 'spikelane simulate --camera {word} -o out/")
        }
        Some("json") => format!("spikelane verify {word}"),
        Some("npy" | "npz") => {
            format!("spikelane inspect {word}' or 'spikelane simulate {word} -o out/{stem}")
        }
        _ => format!("spikelane simulate {word} -o out/{stem}"),
    };
    Some(format!("{word}: found a file, expected a command; type '{typed}'"))
}

/// Returns the message about an argument that another command accepts, about a positional argument too many, or about a value
/// that is no whole number.
fn argument_message(error: &clap::Error, args: &[OsString]) -> Option<String> {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidArg) else { return None };
    if let (ErrorKind::ValueValidation, Some(value)) = (error.kind(), error.get(ContextKind::InvalidValue)) {
        let is_number = error.source().is_some_and(|source| source.is::<std::num::ParseIntError>());
        return is_number.then(|| format!("{word}: found {value}, expected a whole number of at least 0"));
    }
    if error.kind() != ErrorKind::UnknownArgument {
        return None;
    }
    let tree = command();
    let words: Vec<_> = args.iter().skip(1).map(|arg| arg.to_string_lossy()).collect();
    let typed =
        tree.get_subcommands().find(|command| words.iter().any(|word| *word == command.get_name()))?;
    let remedy = format!("type 'spikelane {} --help'", typed.get_name());
    if let Some(flag) = word.strip_prefix("--") {
        let accepts =
            |command: &&clap::Command| command.get_arguments().any(|arg| arg.get_long() == Some(flag));
        let owners: Vec<_> =
            tree.get_subcommands().filter(accepts).map(|c| format!("'{}'", c.get_name())).collect();
        let found = format!("an option of {}", owners.join(", "));
        return (!owners.is_empty()).then(|| {
            format!("{word}: found {found}, expected an option of '{}'; {remedy}", typed.get_name())
        });
    }
    let has_output = words.iter().any(|word| word.starts_with("-o") || word.starts_with("--output"));
    let takes_output = typed.get_arguments().any(|arg| arg.get_long() == Some("output"));
    let remedy = if takes_output && !has_output { "set the output with -o".to_owned() } else { remedy };
    let names = typed
        .get_positionals()
        .map(|arg| format!("<{}>", arg.get_value_names().unwrap_or_default().join(" ")));
    let expected = match names.collect::<Vec<_>>().join(" ") {
        names if names.is_empty() => "no argument without a flag".to_owned(),
        names => format!("only {names} without a flag"),
    };
    (!word.starts_with('-') && !typed.has_subcommands())
        .then(|| format!("{word}: found an argument too many, expected {expected}; {remedy}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_two_examples_that_parse() {
        let mut tree = command();
        tree.build();
        for sub in tree.get_subcommands().filter(|c| c.get_name() != "help") {
            let name = sub.get_name();
            let examples = COMMAND_EXAMPLES.iter().find(|(n, _)| *n == name).map(|(_, examples)| examples);
            for example in examples.unwrap_or_else(|| panic!("{name} has no examples")) {
                for part in example.split("&& spikelane").flat_map(|p| p.split(['|', '>']).next()) {
                    let words = std::iter::once("spikelane").chain(part.split_whitespace());
                    if let Err(error) = command().try_get_matches_from(words) {
                        panic!("{example}: {error}");
                    }
                }
            }
        }
    }

    /// Calls `visit` with the names and the definition of every command, from the first subcommand on.
    fn for_each_command(
        path: &[String],
        command: &clap::Command,
        visit: &mut dyn FnMut(&[String], &clap::Command),
    ) {
        for sub in command.get_subcommands() {
            let path = [path, &[sub.get_name().to_owned()]].concat();
            visit(&path, sub);
            for_each_command(&path, sub, visit);
        }
    }

    #[test]
    fn a_dash_is_a_stream_or_an_error_in_every_path_argument() {
        let mut tree = command();
        tree.build();
        let (mut streams, mut refused) = (Vec::new(), 0);
        for_each_command(&[], &tree, &mut |path, command| {
            for arg in command.get_arguments() {
                let is_path =
                    arg.get_value_parser().type_id() == clap::builder::ValueParser::path_buf().type_id();
                if !is_path {
                    continue;
                }
                let mut words = vec!["spikelane".to_owned()];
                words.extend_from_slice(path);
                match arg.get_long() {
                    Some(flag) => words.extend([format!("--{flag}"), "-".to_owned()]),
                    None => {
                        words.extend((1..=arg.get_index().unwrap()).map(|index| positional(command, index)))
                    }
                }
                let error = command_error(&words);
                if error.as_ref().is_some_and(|e| e.to_string().contains("./-")) {
                    refused += 1;
                } else {
                    streams.push(format!("{} {}", path.join(" "), arg.get_id()));
                }
            }
        });
        streams.sort();
        let expected = [
            "convert input",
            "convert output",
            "inspect file",
            "live input",
            "measure file",
            "reconstruct file",
            "reconstruct output",
            "simulate input",
        ];
        assert_eq!(streams, expected);
        assert!(refused > 30, "{refused}");
    }

    /// Returns the first accepted value of a positional argument, or `-` if it accepts any text.
    fn positional(command: &clap::Command, index: usize) -> String {
        let arg = command.get_positionals().find(|arg| arg.get_index() == Some(index));
        let values = arg.map_or_else(Vec::new, |arg| arg.get_possible_values());
        values.first().map_or_else(|| "-".to_owned(), |value| value.get_name().to_owned())
    }

    fn command_error(words: &[String]) -> Option<clap::Error> {
        command().try_get_matches_from(words).err()
    }

    #[test]
    fn short_help_of_every_command_fits_a_screen() {
        let mut tree = command();
        tree.build();
        for sub in tree.get_subcommands_mut() {
            let lines = sub.render_help().to_string().lines().count();
            assert!(lines <= 45, "{}: {lines} lines", sub.get_name());
        }
    }

    #[test]
    fn a_file_in_place_of_a_command_gets_a_suggestion() {
        let suggestion_for =
            |word: &str| suggestion(&command().try_get_matches_from(["spikelane", word]).unwrap_err());
        assert!(suggestion_for("lake.mp4").unwrap().contains("spikelane simulate lake.mp4 -o out/lake"));
        assert!(suggestion_for("run.dat").unwrap().contains("spikelane inspect run.dat"));
        assert_eq!(suggestion_for("simulat"), None);
    }

    fn message_for(line: &str) -> String {
        let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
        let error = command().try_get_matches_from(&words).unwrap_err();
        argument_message(&error, &words).unwrap_or_else(|| error.to_string())
    }

    #[test]
    fn an_option_of_another_command_is_named() {
        let message = message_for("spikelane simulate lake.mp4 --window 41 -o a");
        assert!(message.starts_with("--window: found an option of 'reconstruct', 'evaluate'"), "{message}");
        assert!(message.ends_with("an option of 'simulate'; type 'spikelane simulate --help'"), "{message}");
        assert!(message_for("spikelane measure a.dat --readout-hz 20000").contains("option of 'simulate'"));
        assert!(message_for("spikelane measure a.dat --no-such-flag 1").contains("unexpected argument"));
    }

    #[test]
    fn a_second_file_leads_to_the_output_flag() {
        assert_eq!(
            message_for("spikelane reconstruct x.png drive.dat"),
            "drive.dat: found an argument too many, expected only <FILE> without a flag; set the output with -o"
        );
        assert!(message_for("spikelane simulate a b.mp4 -o c").contains("type 'spikelane simulate --help'"));
    }

    #[test]
    fn a_negative_number_is_rejected_by_the_option() {
        let exposure = "spikelane simulate a.png -o b --exposure -5".split(' ');
        assert!(command().try_get_matches_from(exposure).is_ok());
        let message = message_for("spikelane simulate a.png -o b --readouts -3");
        assert!(message.ends_with("found -3, expected a whole number of at least 0"), "{message}");
    }
}
