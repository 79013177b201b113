//! Whether a record has all messages that its recorder wrote: they are numbered by topic from 0, and the last one says how many there are.

use std::collections::BTreeMap;

use anyhow::ensure;

/// What is known of a record's messages.
#[derive(Default)]
pub(crate) struct Completeness {
    /// Number of the next message of each topic.
    next: BTreeMap<String, u32>,
    /// Messages that are not there, in words.
    missing: Vec<String>,
    /// Whether the recorder has told how many messages there are.
    is_ended: bool,
}

impl Completeness {
    /// A message has been read.
    pub(super) fn read(&mut self, topic: &str, number: u32) {
        self.expect(topic, number);
        self.next.insert(topic.to_owned(), number.wrapping_add(1));
    }

    /// The recorder's last message has been read: so many messages of each topic there are.
    pub(super) fn end(&mut self, counts: &BTreeMap<String, u32>) {
        self.is_ended = true;
        for (topic, count) in counts {
            self.expect(topic, *count);
        }
    }

    fn expect(&mut self, topic: &str, number: u32) {
        let next = self.next.get(topic).copied().unwrap_or(0);
        if number > next {
            let last = number - 1;
            self.missing
                .push(format!("messages {next} to {last} of {topic}"));
        } else if number < next {
            self.missing.push(format!(
                "what comes before message {number} of {topic}, read out of order,"
            ));
        }
    }

    /// Whether the recorder came to its end, so that messages that are missing at the end are known.
    pub(super) fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// # Errors
    /// Where messages are missing.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        ensure!(
            self.missing.is_empty(),
            "{} are missing: what was lost cannot be replayed",
            self.missing.join(", ")
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(numbers: &[u32], count: Option<u32>) -> Completeness {
        let mut all = Completeness::default();
        for number in numbers {
            all.read("cycle", *number);
        }
        if let Some(count) = count {
            all.end(&BTreeMap::from([("cycle".to_owned(), count)]));
        }
        all
    }

    #[test]
    fn first_middle_and_last_messages_that_are_missing_are_named() {
        read(&[0, 1, 2], Some(3)).check().unwrap();
        for (numbers, count, missing) in [
            (&[1, 2][..], 3, "messages 0 to 0 of cycle"),
            (&[0, 2], 3, "messages 1 to 1 of cycle"),
            (&[0, 1], 4, "messages 2 to 3 of cycle"),
            (&[], 2, "messages 0 to 1 of cycle"),
        ] {
            let error = read(numbers, Some(count)).check().unwrap_err().to_string();
            assert!(error.starts_with(missing), "{error}");
        }
    }

    #[test]
    fn a_record_whose_recorder_did_not_end_may_go_on() {
        let all = read(&[0, 1], None);
        assert!(!all.is_ended() && all.check().is_ok());
    }
}
