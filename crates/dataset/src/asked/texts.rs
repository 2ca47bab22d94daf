//! Serde forms of the options: words as on the command line, one light or a list.

use std::fmt::Display;
use std::str::FromStr;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use spikelane::error::Error;
use spikelane_scene::{Lighting, SamplesPerPixel};

pub(crate) fn read<'de, D: Deserializer<'de>, T: FromStr<Err = Error>>(from: D) -> Result<T, D::Error> {
    String::deserialize(from)?.parse().map_err(|e: Error| {
        let parts = e.parts();
        D::Error::custom(format_args!("{}, expected {}", parts.found, parts.expected))
    })
}

pub(super) fn read_some<'de, D: Deserializer<'de>, T: FromStr<Err = Error>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    read(from).map(Some)
}

pub(crate) fn write<S: Serializer>(value: &impl Display, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(value)
}

pub(super) fn write_some<S: Serializer>(value: &Option<impl Display>, to: S) -> Result<S::Ok, S::Error> {
    value.as_ref().map(ToString::to_string).serialize(to)
}

#[derive(Deserialize, Serialize)]
#[serde(untagged)]
enum Names {
    One(String),
    Several(Vec<String>),
}

pub(super) fn read_lights<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Lighting>, D::Error> {
    let names = match Names::deserialize(from)? {
        Names::One(name) => vec![name],
        Names::Several(names) => names,
    };
    let known = Lighting::ALL.map(Lighting::name).join(", ");
    let light = |name: &String| {
        Lighting::from_name(name)
            .ok_or_else(|| D::Error::custom(format_args!("`{name}`, expected one or more of {known}")))
    };
    names.iter().map(light).collect()
}

pub(super) fn write_lights<S: Serializer>(lights: &[Lighting], to: S) -> Result<S::Ok, S::Error> {
    match lights {
        [one] => one.name().serialize(to),
        all => to.collect_seq(all.iter().map(|l| l.name())),
    }
}

pub(super) fn read_samples<'de, D: Deserializer<'de>>(from: D) -> Result<SamplesPerPixel, D::Error> {
    match u32::deserialize(from)? {
        4 => Ok(SamplesPerPixel::Four),
        16 => Ok(SamplesPerPixel::Sixteen),
        n => Err(D::Error::custom(format_args!("`{n}`, expected 4 or 16"))),
    }
}

pub(super) fn write_samples<S: Serializer>(samples: &SamplesPerPixel, to: S) -> Result<S::Ok, S::Error> {
    (if *samples == SamplesPerPixel::Four { 4 } else { 16 }).serialize(to)
}
