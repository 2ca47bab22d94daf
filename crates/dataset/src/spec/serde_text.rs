//! Serde representations of the options. Values have the same names as on the command line, and lighting is either one
//! preset or a list.

use std::fmt::Display;
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use spikelane::error::Error;
use spikelane_scene::{Lighting, SamplesPerPixel};

pub(crate) fn deserialize_text<'de, D: Deserializer<'de>, T: FromStr<Err = Error>>(
    from: D,
) -> Result<T, D::Error> {
    String::deserialize(from)?.parse().map_err(|e: Error| {
        let parts = e.parts();
        D::Error::custom(format_args!("{}, expected {}", parts.found, parts.expected))
    })
}

pub(super) fn deserialize_optional_text<'de, D: Deserializer<'de>, T: FromStr<Err = Error>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    deserialize_text(from).map(Some)
}

pub(crate) fn serialize_text<S: Serializer>(value: &impl Display, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(value)
}

pub(super) fn serialize_optional_text<S: Serializer>(
    value: &Option<impl Display>,
    to: S,
) -> Result<S::Ok, S::Error> {
    value.as_ref().map(ToString::to_string).serialize(to)
}

#[derive(Deserialize, Serialize)]
#[serde(untagged)]
enum OneOrMany {
    One(String),
    Many(Vec<String>),
}

pub(super) fn deserialize_lighting<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Lighting>, D::Error> {
    let names = match OneOrMany::deserialize(from)? {
        OneOrMany::One(name) => vec![name],
        OneOrMany::Many(names) => names,
    };
    let known = Lighting::ALL.map(Lighting::name).join(", ");
    let light = |name: &String| {
        Lighting::from_name(name)
            .ok_or_else(|| D::Error::custom(format_args!("`{name}`, expected one or more of {known}")))
    };
    names.iter().map(light).collect()
}

pub(super) fn serialize_lighting<S: Serializer>(lights: &[Lighting], to: S) -> Result<S::Ok, S::Error> {
    match lights {
        [one] => one.name().serialize(to),
        all => to.collect_seq(all.iter().map(|l| l.name())),
    }
}

pub(super) fn deserialize_samples<'de, D: Deserializer<'de>>(from: D) -> Result<SamplesPerPixel, D::Error> {
    match u32::deserialize(from)? {
        4 => Ok(SamplesPerPixel::Four),
        16 => Ok(SamplesPerPixel::Sixteen),
        n => Err(D::Error::custom(format_args!("`{n}`, expected 4 or 16"))),
    }
}

pub(super) fn serialize_samples<S: Serializer>(samples: &SamplesPerPixel, to: S) -> Result<S::Ok, S::Error> {
    (if *samples == SamplesPerPixel::Four { 4 } else { 16 }).serialize(to)
}
