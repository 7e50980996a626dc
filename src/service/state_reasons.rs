//! Why states are invalid, in the words of refused fields.

use super::error::Invalid;
use crate::scene::query::InvalidState;

/// Bytes of reasons after which an answer has no further ones, so that an answer about many invalid
/// states still fits in a message.
const MOST_BYTES: usize = 1 << 20;

/// Why states are invalid: one text a state, empty of those that are not.
#[derive(Debug, Default)]
pub(super) struct StateReasons {
    /// Up to the last state that has a text.
    texts: Vec<String>,
    states: usize,
    bytes: usize,
}

impl StateReasons {
    /// Adds a state.
    pub(super) fn push(&mut self, invalid: Option<&InvalidState>) {
        let state = self.states;
        self.states += 1;
        if let Some(invalid) = invalid.filter(|_| self.bytes < MOST_BYTES) {
            let text = reason(invalid, || format!("joint_values[{state}]"));
            self.bytes += text.len();
            self.texts.resize(state, String::new());
            self.texts.push(text);
        }
    }

    /// One text a state; no texts where no state is invalid.
    pub(super) fn into_texts(mut self) -> Vec<String> {
        if !self.texts.is_empty() {
            self.texts.resize(self.states, String::new());
        }
        self.texts
    }
}

/// Why the state of a request with one state is invalid.
pub(super) fn reason_of_one(invalid: &InvalidState) -> String {
    reason(invalid, || "joint_values".to_owned())
}

fn reason(invalid: &InvalidState, joint_values: impl Fn() -> String) -> String {
    let field = invalid.pose().map_or_else(joint_values, |pose| format!("poses[{pose}]"));
    Invalid::new(field, invalid).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::PoseError;

    fn invalid(pose: usize, name: &str) -> InvalidState {
        InvalidState::Pose { object: name.into(), pose: Some(pose), error: PoseError::NotFinite { field: "rotation" } }
    }

    #[test]
    fn valid_states_have_no_texts() {
        let mut reasons = StateReasons::default();
        (0..3).for_each(|_| reasons.push(None));
        assert!(reasons.into_texts().is_empty());
        let mut reasons = StateReasons::default();
        [None, Some(&invalid(1, "cup")), None].into_iter().for_each(|state| reasons.push(state));
        let text = "poses[1]: object \"cup\" has no usable pose: rotation is not finite; poses are finite numbers";
        assert_eq!(reasons.into_texts(), ["", text, ""]);
    }

    #[test]
    fn texts_of_many_states_end_where_a_message_would_be_too_long() {
        let (mut reasons, count) = (StateReasons::default(), 1 << 16);
        let name = "x".repeat(128);
        (0..count).for_each(|state| reasons.push(Some(&invalid(state, &name))));
        let texts = reasons.into_texts();
        assert_eq!(texts.len(), count);
        let given = texts.iter().position(String::is_empty).expect("some have none");
        assert!(texts[given..].iter().all(String::is_empty));
        let bytes: usize = texts.iter().map(String::len).sum();
        assert!((MOST_BYTES..MOST_BYTES + 1024).contains(&bytes), "{bytes}");
        assert!(texts[given - 1].starts_with(&format!("poses[{}]: ", given - 1)));
    }
}
