//! Patterns of names: `*` matches any text, `?` any one letter; case is ignored.

use std::collections::BTreeMap;

/// Returns `true` if a pattern matches the whole text. Time: product of the lengths.
///
/// A [`Glob`] is faster for many texts that begin alike.
#[must_use]
pub fn is_match(glob: &str, text: &str) -> bool {
    let (glob, text): (Vec<char>, Vec<char>) = (folded(glob).collect(), folded(text).collect());
    let (mut g, mut t) = (0, 0);
    let mut back: Option<(usize, usize)> = None;
    while t < text.len() {
        match glob.get(g) {
            Some('*') => {
                back = Some((g + 1, t));
                g += 1;
            }
            Some(&c) if c == '?' || c == text[t] => {
                g += 1;
                t += 1;
            }
            _ => match back {
                None => return false,
                Some((after, from)) => {
                    g = after;
                    t = from + 1;
                    back = Some((after, t));
                }
            },
        }
    }
    glob[g..].iter().all(|&c| c == '*')
}

fn folded(text: &str) -> impl Iterator<Item = char> {
    text.chars().flat_map(char::to_lowercase)
}

/// A pattern matched letter by letter, so that a common beginning of many texts is read once: the paths of a tree of
/// names.
///
/// All positions that a text may have reached in the pattern are bits of a number, shifted together (Baeza-Yates &
/// Gonnet, "A new approach to text searching", 1992). Time: letters of the text, times those of the pattern over 64.
#[derive(Clone, Debug)]
pub struct Glob {
    /// Positions of each letter in the pattern; each `?` counts as every letter.
    places: BTreeMap<char, Vec<u64>>,
    /// Positions of `?`.
    any: Vec<u64>,
    /// Positions after a `*`, at which any letters may be read.
    stays: Vec<u64>,
    /// Letters of the pattern without `*`.
    n: usize,
}

/// Positions of a [`Glob`] that a text has reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GlobState(Vec<u64>);

impl Glob {
    /// Compiles a pattern.
    #[must_use]
    pub fn new(pattern: &str) -> Self {
        let letters: Vec<char> = folded(pattern).collect();
        let n = letters.iter().filter(|&&c| c != '*').count();
        let none = vec![0_u64; n / 64 + 1];
        let set = |bits: &mut Vec<u64>, i: usize| bits[i / 64] |= 1 << (i % 64);
        let (mut any, mut stays) = (none.clone(), none.clone());
        let mut places: BTreeMap<char, Vec<u64>> = BTreeMap::new();
        let mut i = 0;
        for c in letters {
            match c {
                '*' => set(&mut stays, i),
                '?' => set(&mut any, i),
                c => set(places.entry(c).or_insert_with(|| none.clone()), i),
            }
            i += usize::from(c != '*');
        }
        for place in places.values_mut() {
            place.iter_mut().zip(&any).for_each(|(p, a)| *p |= a);
        }
        Self {
            places,
            any,
            stays,
            n,
        }
    }

    /// Returns the state before the first letter.
    #[must_use]
    #[doc(hidden)]
    pub fn start(&self) -> GlobState {
        let mut bits = vec![0; self.any.len()];
        bits[0] = 1;
        GlobState(bits)
    }

    /// Reads the next part of a text.
    #[doc(hidden)]
    pub fn read(&self, state: &mut GlobState, text: &str) {
        for c in folded(text) {
            let places = self.places.get(&c).unwrap_or(&self.any);
            let mut carry = 0;
            for ((bits, place), stay) in state.0.iter_mut().zip(places).zip(&self.stays) {
                let moved = *bits & place;
                *bits = (moved << 1) | carry | (*bits & stay);
                carry = moved >> 63;
            }
        }
    }

    /// Returns `true` if the pattern matches all that was read.
    #[must_use]
    pub fn fits(&self, state: &GlobState) -> bool {
        state.0[self.n / 64] >> (self.n % 64) & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn globs_match_as_shells_do() {
        for (glob, text, fits) in [
            ("*", "", true),
            ("", "", true),
            ("", "a", false),
            ("a*c", "ABBC", true),
            ("a*c", "abcd", false),
            ("?b", "ab", true),
            ("?b", "b", false),
            ("*a*b*", "xaybz", true),
            ("**", "x", true),
            ("\u{c4}*", "\u{e4}b", true),
            ("*ab", "aab", true),
        ] {
            assert_eq!(is_match(glob, text), fits, "{glob} {text}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn letters_read_one_by_one_fit_as_whole_texts_do(
            pattern in "[abÄ?*]{0,12}", long in 0_usize..3, text in "[abÄä/]{0,12}", cut in 0_usize..12,
        ) {
            // Longer than a word's bits, too.
            let ahead = "a?".repeat(long * 33);
            let (pattern, text) = (format!("{ahead}{pattern}"), format!("{}{text}", "ab".repeat(long * 33)));
            let glob = Glob::new(&pattern);
            let mut state = glob.start();
            let cut = text.char_indices().nth(cut).map_or(text.len(), |c| c.0);
            glob.read(&mut state, &text[..cut]);
            glob.read(&mut state, &text[cut..]);
            prop_assert_eq!(glob.fits(&state), is_match(&pattern, &text), "{} {}", pattern, text);
        }
    }
}
