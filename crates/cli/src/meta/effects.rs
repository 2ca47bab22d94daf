//! Implements `spikelane effects`.

use serde_json::json;
use spikelane::effects::ALL;
use spikelane::effects::definition::{Param, ParamKind};
use spikelane::{Result, effects};

use crate::common::Console;

/// List effects with their parameters, units and ranges
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// List only this effect
    name: Option<String>,
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    let one = args.name.as_deref().map(effects::find).transpose()?;
    for effect in ALL.iter().copied().filter(|e| one.is_none_or(|one| one.name == e.name)) {
        let params: Vec<_> = effect.params.iter().map(param_json).collect();
        let mut text = format!("{}\n    {}\n    Source: {}\n", effect.name, effect.summary, effect.source);
        for p in effect.params {
            text += &format!("    {:18} {}; {}\n", p.key, p.help, value_range(p));
        }
        let event = json!({"effect": effect.name, "summary": effect.summary, "source": effect.source, "parameters": params});
        out.print_result(&event, &(text + "\n"))?;
    }
    Ok(())
}

fn value_range(p: &Param) -> String {
    format!("{}, neutral {}, typical {}", p.range(), p.format(p.neutral), p.format(p.typical))
}

/// Returns a number as JSON in the stored unit. An infinite number becomes a string, with the spelling of camera files.
fn number_json(p: &Param, value: f64) -> serde_json::Value {
    if value.is_finite() { json!(value) } else { json!(p.format(value)) }
}

fn param_json(p: &Param) -> serde_json::Value {
    match p.kind {
        ParamKind::Number { unit, low, high } => json!({
            "key": p.key, "unit": unit.symbol(), "low": number_json(p, low), "high": number_json(p, high),
            "neutral": number_json(p, p.neutral), "typical": number_json(p, p.typical), "help": p.help,
        }),
        ParamKind::Choice(words) => json!({
            "key": p.key, "choices": words,
            "neutral": p.format(p.neutral), "typical": p.format(p.typical), "help": p.help,
        }),
    }
}
