//! Words of names.

/// Returns lower-case words, split at characters other than letters, between a small letter and a capital, and before the capital of a
/// word that follows an abbreviation: `GIVolume` is `gi volume`, `TVs` one word.
#[must_use]
pub fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let mut was_lower = false;
    for (at, c) in name.char_indices() {
        let begins_word = || {
            let mut next = name[at..].chars().skip(1);
            (0..2).all(|_| next.next().is_some_and(char::is_lowercase))
        };
        let is_cut = !c.is_alphabetic() || (c.is_uppercase() && (was_lower || begins_word()));
        if is_cut && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        was_lower = c.is_lowercase();
        if c.is_alphabetic() {
            word.extend(c.to_lowercase());
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_end_at_capitals_and_abbreviations_at_the_next_word() {
        for (name, expected) in [
            ("GIVolume_2", "gi volume"),
            ("TVs", "tvs"),
            ("IFCWall", "ifc wall"),
            ("WallDoor", "wall door"),
            ("RoomÜber", "room über"),
            ("ABC", "abc"),
        ] {
            assert_eq!(words(name).join(" "), expected, "{name}");
        }
    }
}
