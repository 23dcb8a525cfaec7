//! Headers in JSON.

use serde_json::{Map, Value};

use crate::SourceError;

/// Returns `true` if a file looks like JSON with `"enfilade": "KIND"` among its first keys.
pub(crate) fn is_json_of(bytes: &[u8], kind: &str) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let packed: String = head.split_ascii_whitespace().collect();
    packed.starts_with('{') && packed.contains(&format!("\"enfilade\":\"{kind}\""))
}

/// Refuses keys other than those known.
pub(crate) fn known_keys(
    map: &Map<String, Value>,
    place: &str,
    keys: &[&str],
) -> Result<(), SourceError> {
    match map.keys().find(|k| !keys.contains(&k.as_str())) {
        None => Ok(()),
        Some(key) => {
            let problem = format!(
                "'{}' is unknown; known are {}",
                shortened(key),
                keys.join(", ")
            );
            Err(SourceError::new(place, problem))
        }
    }
}

/// Returns a word short enough for a message.
pub(crate) fn shortened(word: &str) -> String {
    if word.chars().count() <= 40 {
        word.to_owned()
    } else {
        word.chars().take(37).chain("...".chars()).collect()
    }
}
