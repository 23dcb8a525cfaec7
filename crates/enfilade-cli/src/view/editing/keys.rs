//! Keys of the editor.

use winit::keyboard::KeyCode;

use super::editor::EditKey;

/// Lines of the help about editing.
pub(crate) const EDIT_HELP: &str = "\
B              edit, or only walk
1 to 9, wheel  take a piece of the palette; [ ]: the next
F6 to F10      portal, door, mirror, lamp, crate
click          place it; Shift+click, Enter: more vertices
, .            turn what is in hand
V, G, X        turn, move, take away what is there
Z, Y           undo, redo
N              go to the next open doorway
F2             save";

/// Returns the meaning of a key.
pub(crate) fn edit_key(code: KeyCode) -> Option<EditKey> {
    const DIGITS: [KeyCode; 9] = [
        KeyCode::Digit1,
        KeyCode::Digit2,
        KeyCode::Digit3,
        KeyCode::Digit4,
        KeyCode::Digit5,
        KeyCode::Digit6,
        KeyCode::Digit7,
        KeyCode::Digit8,
        KeyCode::Digit9,
    ];
    if let Some(at) = DIGITS.iter().position(|d| *d == code) {
        return Some(EditKey::Choose(at));
    }
    const BY_HAND: [KeyCode; 5] = [
        KeyCode::F6,
        KeyCode::F7,
        KeyCode::F8,
        KeyCode::F9,
        KeyCode::F10,
    ];
    if let Some(at) = BY_HAND.iter().position(|d| *d == code) {
        return Some(EditKey::ByHand(at));
    }
    Some(match code {
        KeyCode::KeyB => EditKey::OnOff,
        KeyCode::BracketLeft => EditKey::Step(-1),
        KeyCode::BracketRight => EditKey::Step(1),
        KeyCode::Comma => EditKey::Turn(-1),
        KeyCode::Period => EditKey::Turn(1),
        KeyCode::Enter | KeyCode::NumpadEnter => EditKey::Finish,
        KeyCode::KeyV => EditKey::TurnThere,
        KeyCode::KeyG => EditKey::Grab,
        KeyCode::KeyX | KeyCode::Delete => EditKey::Delete,
        KeyCode::KeyZ => EditKey::Undo,
        KeyCode::KeyY => EditKey::Redo,
        KeyCode::KeyN => EditKey::Next,
        KeyCode::Escape => EditKey::Cancel,
        _ => return None,
    })
}
