//! Digests of the suites of this crate, as published.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::Suite;

/// The table of digests by the name of the suite.
const DIGESTS: &str = include_str!("../../suites/digests.toml");

/// The digest of one version of a suite.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PublishedDigest {
    version: String,
    scene_version: u32,
    digest: String,
}

impl Suite {
    /// Returns the published digest of the suite, or `None` if no digest is published for this name, version and version
    /// of the scenes. A revealed suite has secret seeds, so no digest of it is published in advance.
    ///
    /// # Examples
    /// ```
    /// use spikelane_benchmark::suite::Suite;
    /// let quick = Suite::builtin("quick")?;
    /// assert!(quick.published_digest().is_some_and(|digest| digest.starts_with("blake3:")));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn published_digest(&self) -> Option<String> {
        find(DIGESTS, self)
    }

    /// Returns a message if `digest` differs from the published digest of the suite.
    #[must_use]
    pub fn publication_mismatch(&self, digest: &str) -> Option<String> {
        mismatch(DIGESTS, self, digest)
    }
}

fn find(table: &str, suite: &Suite) -> Option<String> {
    // The unit test parses the table, so an invalid table does not pass the tests.
    let table: BTreeMap<String, PublishedDigest> = toml::from_str(table).unwrap_or_default();
    let entry = table.get(suite.name.as_str()).filter(|_| suite.sealed.is_none())?;
    let is_same = (&entry.version, entry.scene_version) == (&suite.version, suite.scene_version);
    is_same.then(|| entry.digest.clone())
}

fn mismatch(table: &str, suite: &Suite, digest: &str) -> Option<String> {
    let published = find(table, suite).filter(|published| published != digest)?;
    Some(format!(
        "not the data of the suite {} {} as published: the digest is {digest}, the published digest is {published}",
        suite.name, suite.version
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(name: &str, suite: &Suite) -> String {
        let (version, scenes) = (&suite.version, suite.scene_version);
        format!("[{name}]\nversion = \"{version}\"\nscene_version = {scenes}\ndigest = \"blake3:aa\"\n")
    }

    #[test]
    fn the_table_lists_only_suites_of_this_crate() {
        let table: BTreeMap<String, PublishedDigest> = toml::from_str(DIGESTS).unwrap();
        for (name, entry) in table {
            assert!(Suite::builtin_names().any(|known| known == name), "{name}");
            let hex = entry.digest.strip_prefix("blake3:").unwrap();
            assert!(hex.len() == 64 && hex.bytes().all(|b| b.is_ascii_hexdigit()), "{name}");
        }
    }

    #[test]
    fn another_digest_of_a_published_suite_is_named() {
        let suite = Suite::builtin("quick").unwrap();
        let table = table("quick", &suite);
        assert_eq!(mismatch(&table, &suite, "blake3:aa"), None);
        let message = mismatch(&table, &suite, "blake3:bb").unwrap();
        assert!(message.contains("blake3:aa") && message.contains("blake3:bb"), "{message}");
    }

    #[test]
    fn a_digest_belongs_to_one_suite_version_and_scene_version() {
        let quick = Suite::builtin("quick").unwrap();
        let mut other_version = quick.clone();
        other_version.version = "99.0.0".into();
        let mut other_scenes = quick.clone();
        other_scenes.scene_version += 1;
        let mut revealed = quick.clone();
        revealed.sealed = Some("blake3:cc".into());
        for suite in [other_version, other_scenes, revealed, Suite::builtin("flow").unwrap()] {
            assert_eq!(mismatch(&table("quick", &quick), &suite, "blake3:bb"), None, "{}", suite.name);
        }
    }
}
