//! Keys of a review.

use winit::keyboard::KeyCode;

use super::reviewer::ReviewKey;

/// Steps taken at once by the keys for many.
const MANY: isize = 10;

/// Lines of the help about a review.
pub(crate) const REVIEW_HELP: &str = "\
N, B           a step forwards, or back; Page Down, Page Up: ten
G              to where the decimation stops by itself
Home, End      to its begin, or its end
K, J           keep, join the portal of the next step;
               with Shift: the portal at the crosshair
Z, Y           undo, redo a decision
V              go before the portal of the next step
F2             save the decisions
F3             bake the rooms of this step, and show them
X              show the scene, or the baked rooms";

/// Returns the meaning of a key; `is_there` if Shift is held.
pub(crate) fn review_key(code: KeyCode, is_there: bool) -> Option<ReviewKey> {
    Some(match code {
        KeyCode::KeyN => ReviewKey::Step(1),
        KeyCode::KeyB => ReviewKey::Step(-1),
        KeyCode::PageDown => ReviewKey::Step(MANY),
        KeyCode::PageUp => ReviewKey::Step(-MANY),
        KeyCode::Home => ReviewKey::Step(isize::MIN),
        KeyCode::End => ReviewKey::Step(isize::MAX),
        KeyCode::KeyG => ReviewKey::Stop,
        KeyCode::KeyK => ReviewKey::Keep { is_there },
        KeyCode::KeyJ => ReviewKey::Join { is_there },
        KeyCode::KeyZ => ReviewKey::Undo,
        KeyCode::KeyY => ReviewKey::Redo,
        KeyCode::KeyV => ReviewKey::Visit,
        KeyCode::F2 => ReviewKey::Save,
        KeyCode::F3 => ReviewKey::Bake,
        KeyCode::KeyX => ReviewKey::Switch,
        _ => return None,
    })
}
