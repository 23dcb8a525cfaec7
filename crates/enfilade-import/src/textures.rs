//! Texture references within the JSON of a material.

use serde_json::Value;

/// Changes the index of every texture reference: an object under a key that ends in `Texture`, anywhere in the
/// material except its `extras`. `number` returns the new index for a key and an old index.
pub(crate) fn map_textures(
    value: &mut Value,
    number: &mut dyn FnMut(&str, &Value) -> Result<Value, String>,
) -> Result<(), String> {
    // serde_json bounds the nesting of its output, and so this recursion.
    match value {
        Value::Array(items) => items
            .iter_mut()
            .try_for_each(|item| map_textures(item, number)),
        Value::Object(fields) => {
            for (key, inner) in fields.iter_mut().filter(|(key, _)| *key != "extras") {
                if key.ends_with("Texture")
                    && let Some(index) = inner.get_mut("index")
                {
                    *index = number(key, index)?;
                }
                map_textures(inner, number)?;
            }
            Ok(())
        }
        _ => Ok(()),
    }
}
