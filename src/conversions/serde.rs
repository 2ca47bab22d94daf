//! Feature `serde`: a geometry as `{width, height}`. Deserialization checks both sides.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::spikes::Geometry;

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename = "Geometry")]
struct Sides {
    width: u32,
    height: u32,
}

impl Serialize for Geometry {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // The casts are exact, because a `Geometry` is created from 32-bit numbers.
        Sides { width: self.width() as u32, height: self.height() as u32 }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Geometry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Sides { width, height } = Sides::deserialize(deserializer)?;
        Self::new(width, height).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use crate::{Geometry, Seeds, Spike};

    #[test]
    fn plain_values_read_back_as_they_were_written() {
        let geometry = Geometry::new(400, 250).unwrap();
        let text = serde_json::to_string(&geometry).unwrap();
        assert_eq!(text, r#"{"width":400,"height":250}"#);
        assert_eq!(serde_json::from_str::<Geometry>(&text).unwrap(), geometry);
        let seeds = Seeds { camera: 1, shot: 2, sequence: u64::MAX };
        assert_eq!(serde_json::from_str::<Seeds>(&serde_json::to_string(&seeds).unwrap()).unwrap(), seeds);
        let spike = Spike { readout: 3, row: 2, col: 1 };
        assert_eq!(serde_json::from_str::<Spike>(&serde_json::to_string(&spike).unwrap()).unwrap(), spike);
    }

    #[test]
    fn a_geometry_without_pixels_is_refused() {
        let error = serde_json::from_str::<Geometry>(r#"{"width":0,"height":250}"#).unwrap_err();
        assert!(error.to_string().contains("0x250"), "{error}");
    }
}
