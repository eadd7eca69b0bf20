//! Which messages and signals are wanted.

use j1939::message::MESSAGES;
use tractrix_core::words;

use crate::bus_content::{Content, OTHER_SIGNALS, OTHERS};
use crate::failure::Failure;

/// A choice of messages and signals; without any, everything.
#[derive(Debug)]
pub(super) struct Wanted(Vec<Choice>);

/// Message, signal, or both.
#[derive(Debug)]
struct Choice {
    message: Option<String>,
    signal: Option<String>,
}

impl Wanted {
    /// # Errors
    /// For a name that is no message, no signal, or no signal of its message.
    pub(super) fn of(list: &[String]) -> Result<Self, Failure> {
        list.iter().map(|word| choice(word)).collect::<Result<_, _>>().map(Self)
    }

    /// What is wanted of a message; none when that is nothing.
    pub(super) fn of_message(&self, message: &str, content: Content) -> Option<Content> {
        if self.0.is_empty() {
            return Some(content);
        }
        let of_message = |choice: &&Choice| choice.message.as_ref().is_none_or(|m| m == message);
        let choices: Vec<&Choice> = self.0.iter().filter(of_message).collect();
        match content {
            Content::Said(mut items) => {
                items.retain(|item| {
                    choices.iter().any(|c| c.signal.as_ref().is_none_or(|s| s == item.name))
                });
                (!items.is_empty()).then_some(Content::Said(items))
            }
            // a message that cannot be decoded lacks the signals that were wanted of it
            wrong => choices.iter().any(|c| c.message.is_some()).then_some(wrong),
        }
    }
}

fn choice(word: &str) -> Result<Choice, Failure> {
    let (message, signal) = match word.split_once('.') {
        Some((message, signal)) => (Some(message), Some(signal)),
        None if messages().any(|name| name == word) => (Some(word), None),
        None => (None, Some(word)),
    };
    let unknown = |what: &str, names: Vec<&str>| {
        let near = words::nearest(word, names).join(", ");
        Failure::Input(format!("--signals {word}: no such {what}; the nearest are {near}"))
    };
    if let Some(message) = message
        && !messages().any(|name| name == message)
    {
        return Err(unknown("message", messages().collect()));
    }
    if let Some(signal) = signal {
        let mut names: Vec<&str> = signals(message).collect();
        if !names.contains(&signal) {
            names.extend(messages().filter(|_| message.is_none()));
            return Err(unknown("signal", names));
        }
    }
    Ok(Choice { message: message.map(str::to_owned), signal: signal.map(str::to_owned) })
}

fn messages() -> impl Iterator<Item = &'static str> {
    MESSAGES.iter().map(|message| message.name).chain(OTHERS.iter().map(|(_, name)| *name))
}

/// Signals of a message, or of all.
fn signals(of: Option<&str>) -> impl Iterator<Item = &'static str> {
    let tables = MESSAGES.iter().filter(move |message| of.is_none_or(|of| of == message.name));
    let without_table = of.is_none_or(|of| OTHERS.iter().any(|(_, name)| *name == of));
    let others = OTHER_SIGNALS.into_iter().filter(move |_| without_table);
    tables.flat_map(|message| message.signals).map(|signal| signal.name).chain(others)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_do_not_exist_come_with_the_nearest() {
        for (word, near) in [("EEC9", "EEC"), ("CCVS1.sped_m_s", "speed_m_s"), ("vim", "vin")] {
            let line = Wanted::of(&[word.to_owned()]).unwrap_err().line();
            assert!(line.contains(word) && line.contains(near), "{line}");
        }
        for word in ["EEC1", "speed_m_s", "CCVS1.speed_m_s", "DM1", "vin", "DM1.dtc"] {
            assert!(Wanted::of(&[word.to_owned()]).is_ok(), "{word}");
        }
        assert!(Wanted::of(&["EEC1.speed_m_s".to_owned()]).is_err(), "a signal of another message");
    }
}
