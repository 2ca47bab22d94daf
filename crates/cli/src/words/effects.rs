//! `spikelane effects`.

use serde_json::json;
use spikelane::effects::ALL;
use spikelane::effects::definition::{Form, Param};
use spikelane::{Result, effects};

use crate::shared::output::Out;

/// List effects with their parameters, units and ranges
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Only this effect
    name: Option<String>,
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let one = args.name.as_deref().map(effects::find).transpose()?;
    for effect in ALL.iter().copied().filter(|e| one.is_none_or(|one| one.name == e.name)) {
        let params: Vec<_> = effect.params.iter().map(param).collect();
        let mut text = format!("{}\n    {}\n    Source: {}\n", effect.name, effect.summary, effect.source);
        for p in effect.params {
            text += &format!("    {:18} {}; {}\n", p.key, p.help, values(p));
        }
        let event = json!({"effect": effect.name, "summary": effect.summary, "source": effect.source, "params": params});
        out.result(&event, &(text + "\n"))?;
    }
    Ok(())
}

fn values(p: &Param) -> String {
    format!("{}, off at {}, typically {}", p.range(), p.format(p.neutral), p.format(p.typical))
}

/// A number in the stored unit, or the word that stands for none.
fn number(p: &Param, value: f64) -> serde_json::Value {
    if value.is_finite() { json!(value) } else { json!(p.format(value)) }
}

fn param(p: &Param) -> serde_json::Value {
    match p.form {
        Form::Number { unit, low, high } => json!({
            "key": p.key, "unit": unit.symbol(), "low": number(p, low), "high": number(p, high),
            "neutral": number(p, p.neutral), "typical": number(p, p.typical), "help": p.help,
        }),
        Form::Choice(words) => json!({
            "key": p.key, "words": words,
            "neutral": p.format(p.neutral), "typical": p.format(p.typical), "help": p.help,
        }),
    }
}
