//! Options and their defaults.

use std::io::Write;

use clap::Args;
use semismooth::complementarity::McpOptions;
use semismooth::contact::{ContactOptions, DelassusOptions};
use semismooth::continuation::{ContinuationOptions, DiagramOptions, SearchOptions};
use semismooth::enumeration::EnumerationOptions;
use semismooth::newton::NewtonOptions;
use serde_json::Value;

use super::error::CommandError;

/// Prints options with their defaults, in the form of the table [options] of a run file
#[derive(Debug, Args)]
pub struct OptionsArgs {
    #[arg(value_parser = KINDS, default_value = "continuation", hide_possible_values = true)]
    #[arg(help = format!("Of what: {},\n{}", KINDS[..5].join(", "), KINDS[5..].join(", ")))]
    kind: String,
    /// As one JSON object
    #[arg(long)]
    json: bool,
}

const KINDS: [&str; 8] = [
    "contact",
    "continuation",
    "delassus",
    "diagram",
    "enumeration",
    "mcp",
    "newton",
    "search",
];

pub(super) fn run(arguments: &OptionsArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    let value = match arguments.kind.as_str() {
        "contact" => serde_json::to_value(ContactOptions::default()),
        "delassus" => serde_json::to_value(DelassusOptions::default()),
        "diagram" => serde_json::to_value(DiagramOptions::default()),
        "enumeration" => serde_json::to_value(EnumerationOptions::default()),
        "mcp" => serde_json::to_value(McpOptions::default()),
        "newton" => serde_json::to_value(NewtonOptions::default()),
        "search" => serde_json::to_value(SearchOptions::default()),
        _ => serde_json::to_value(ContinuationOptions::default()),
    };
    let value = value.map_err(|e| CommandError::failed("the options", e))?;
    if arguments.json {
        return Ok(writeln!(out, "{value}")?);
    }
    table(&value, "", out)
}

/// Plain values before subtables, as TOML requires; keys without a default are commented out.
fn table(value: &Value, prefix: &str, out: &mut dyn Write) -> Result<(), CommandError> {
    let Value::Object(fields) = value else {
        return Ok(());
    };
    for (name, value) in fields.iter().filter(|f| !f.1.is_object()) {
        match value {
            Value::Null => writeln!(out, "# {name} =")?,
            Value::Array(list) if list.iter().any(Value::is_null) => writeln!(out, "# {name} =")?,
            Value::Array(list) if list.len() > 4 => {
                writeln!(out, "{name} = [")?;
                for value in list {
                    writeln!(out, "    {value},")?;
                }
                writeln!(out, "]")?;
            }
            value => writeln!(out, "{name} = {value}")?,
        }
    }
    for (name, value) in fields.iter().filter(|f| f.1.is_object()) {
        let name = if prefix.is_empty() {
            name.clone()
        } else {
            format!("{prefix}.{name}")
        };
        writeln!(out, "\n[{name}]")?;
        table(value, &name, out)?;
    }
    Ok(())
}
