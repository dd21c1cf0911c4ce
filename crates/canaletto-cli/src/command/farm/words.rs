//! The words of a command line by the arguments that they belong to, so that a job repeats them as they were typed.

use clap::{ArgAction, Command};
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// The words of one argument: a flag with its value, or a positional argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Group {
    /// The argument's id; none if the command has no such argument.
    pub(super) id: Option<String>,
    pub(super) words: Vec<OsString>,
}

/// Groups the words of a command line that the command has accepted.
pub(super) fn group(words: &[OsString], command: &Command) -> Vec<Group> {
    let mut positionals = command.get_positionals().map(|arg| (arg.get_id().to_string(), is_list(arg)));
    let mut positional = positionals.next();
    let mut groups: Vec<Group> = Vec::new();
    let mut words = words.iter().cloned();
    let mut is_rest = false;
    while let Some(word) = words.next() {
        let text = word.to_string_lossy().into_owned();
        if !is_rest && text == "--" {
            is_rest = true;
            continue;
        }
        if is_rest || !text.starts_with('-') || text == "-" {
            let id = positional.clone();
            if !id.as_ref().is_some_and(|(_, is_list)| *is_list) {
                positional = positionals.next();
            }
            groups.push(Group { id: id.map(|(id, _)| id), words: vec![word] });
            continue;
        }
        let mut own = vec![word];
        let (id, takes_next) = match text.strip_prefix("--") {
            Some(long) => long_flag(long, command),
            None => short_flags(&text, command),
        };
        if takes_next {
            own.extend(words.next());
        }
        groups.push(Group { id, words: own });
    }
    groups
}

fn is_list(arg: &clap::Arg) -> bool {
    arg.get_num_args().is_some_and(|count| count.max_values() > 1) || matches!(arg.get_action(), ArgAction::Append)
}

/// Whether the next word is the flag's value.
fn takes_next(arg: &clap::Arg) -> bool {
    arg.get_action().takes_values() && !arg.is_require_equals_set()
}

/// The id of `--long`, with or without `=value`, and whether the next word is its value.
fn long_flag(text: &str, command: &Command) -> (Option<String>, bool) {
    let (long, has_value) = text.split_once('=').map_or((text, false), |(long, _)| (long, true));
    let mut args = command.get_arguments();
    let arg = args.find(|arg| {
        arg.get_long() == Some(long) || arg.get_all_aliases().is_some_and(|aliases| aliases.contains(&long))
    });
    (arg.map(|arg| arg.get_id().to_string()), arg.is_some_and(|arg| !has_value && takes_next(arg)))
}

/// The id of the last of some short flags, such as `-q` or `-ofile`, and whether the next word is its value.
fn short_flags(text: &str, command: &Command) -> (Option<String>, bool) {
    let letters: Vec<char> = text.chars().skip(1).collect();
    for (index, letter) in letters.iter().enumerate() {
        let arg = command.get_arguments().find(|arg| arg.get_short() == Some(*letter));
        let Some(arg) = arg else { return (None, false) };
        let is_last = index + 1 == letters.len();
        if takes_next(arg) || is_last {
            return (Some(arg.get_id().to_string()), takes_next(arg) && is_last);
        }
    }
    (None, false)
}

/// A word for a shell, in quotes where it needs them.
pub(super) fn shell_word(word: &OsStr) -> Vec<u8> {
    let bytes = word.as_encoded_bytes();
    // The first of the characters stands for a part's number. zsh expands `=word`.
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"\x01_./:=,+-@%".contains(byte);
    if !bytes.is_empty() && bytes.iter().all(is_plain) && bytes[0] != b'=' {
        return bytes.to_vec();
    }
    quoted(bytes)
}

/// A path as people type it in a shell, in one line.
pub(super) fn typed(path: &Path) -> String {
    String::from_utf8_lossy(&shell_word(path.as_os_str())).replace('\n', " ")
}

/// Bytes as one word for a shell, in quotes.
pub(super) fn quoted(bytes: &[u8]) -> Vec<u8> {
    let mut quoted = vec![b'\''];
    for byte in bytes {
        match byte {
            b'\'' => quoted.extend(b"'\\''"),
            other => quoted.push(*other),
        }
    }
    quoted.push(b'\'');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Arg;

    fn command() -> Command {
        Command::new("c")
            .arg(Arg::new("engine"))
            .arg(Arg::new("scene"))
            .arg(Arg::new("more").num_args(0..))
            .arg(Arg::new("output").short('o').long("output"))
            .arg(Arg::new("quiet").short('q').long("quiet").action(ArgAction::SetTrue))
            .arg(Arg::new("denoise").long("denoise").num_args(0..=1).require_equals(true))
            .arg(Arg::new("pattern").long("pattern").alias("sample"))
            .arg(Arg::new("set").long("set").action(ArgAction::Append))
    }

    #[test]
    fn words_belong_to_their_arguments() {
        let line = "slurm -qo a.png s.kdl --denoise --sample jittered --set=x=1 --set y=2 --output=b -oc -o=d -q -- -t";
        let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        let groups = group(&words, &command());
        let told: Vec<String> = groups
            .iter()
            .map(|group| {
                let words: Vec<_> = group.words.iter().map(|word| word.to_string_lossy()).collect();
                format!("{}: {}", group.id.as_deref().unwrap_or("?"), words.join(" "))
            })
            .collect();
        let expected = [
            "engine: slurm",
            "output: -qo a.png",
            "scene: s.kdl",
            "denoise: --denoise",
            "pattern: --sample jittered",
            "set: --set=x=1",
            "set: --set y=2",
            "output: --output=b",
            "output: -oc",
            "output: -o=d",
            "quiet: -q",
            "more: -t",
        ];
        assert_eq!(told, expected);
    }

    #[test]
    fn words_are_quoted_for_shells() {
        for (word, quoted) in [
            ("scenes/path.kdl", "scenes/path.kdl"),
            ("a b", "'a b'"),
            ("it's", "'it'\\''s'"),
            ("", "''"),
            ("a\nb", "'a\nb'"),
            ("$HOME", "'$HOME'"),
            ("~", "'~'"),
            ("100%", "100%"),
        ] {
            assert_eq!(String::from_utf8(shell_word(OsStr::new(word))).unwrap(), quoted);
        }
    }
}
