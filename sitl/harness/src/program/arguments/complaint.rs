//! What is wrong with a command line, in one line.

use clap::error::{ContextKind, ContextValue};

/// The cause, and the nearest right word or the help.
pub(super) fn of(error: &clap::Error) -> String {
    let text = error.to_string();
    let cause = text.split("\n\n").next().unwrap_or(&text);
    let words: Vec<&str> = cause.split_whitespace().collect();
    format!("{}: {}", words.join(" ").trim_start_matches("error: "), advice(error))
}

fn advice(error: &clap::Error) -> String {
    let suggested =
        [ContextKind::SuggestedSubcommand, ContextKind::SuggestedArg, ContextKind::SuggestedValue];
    let word = suggested.into_iter().find_map(|kind| match error.get(kind)? {
        ContextValue::String(word) => Some(word.clone()),
        ContextValue::Strings(words) => words.first().cloned(),
        _ => None,
    });
    word.map_or_else(|| "see `gleaner-sitl --help`".to_owned(), |word| format!("did you mean {word}?"))
}

#[cfg(test)]
mod tests {
    use super::super::Arguments;
    use super::of;
    use clap::Parser;

    #[test]
    fn a_misspelled_word_gets_the_right_one_suggested() {
        for (words, suggestion) in [
            (vec!["flly"], "did you mean fly?"),
            (vec!["fly", "--scenari", "rd"], "did you mean --scenario?"),
            (vec!["fly", "--seed", "x"], "see `gleaner-sitl --help`"),
        ] {
            let error = Arguments::try_parse_from([vec!["gleaner-sitl"], words].concat()).unwrap_err();
            let line = of(&error);
            assert!(line.ends_with(suggestion) && !line.contains('\n'), "{line}");
        }
    }
}
