//! The order of modules, read from the sources of all crates. Modules of a crate form no circle. A module uses only
//! modules above it in the tables of ARCHITECTURE.md.

use canaletto_tests::root;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The tables of ARCHITECTURE.md: the crate, and the sentence before its table.
const TABLES: [(&str, &str); 2] = [
    ("canaletto", "Inside the library a module uses only modules above it."),
    ("canaletto-io", "Inside `canaletto-io` a module uses only modules above it, too."),
];

/// A file below a crate's `src`, and the path of a module or an item that it uses: its names from the crate's root.
type Import = (String, String);

/// The parts of a source: words, `::` and single signs. Comments, texts and characters are left out.
fn tokens(source: &str) -> Vec<&str> {
    let find = |from: usize, end: &str| source[from..].find(end).map_or(source.len(), |at| from + at + end.len());
    let (mut tokens, mut at) = (Vec::new(), 0);
    while let Some(rest) = source.get(at..).filter(|rest| !rest.is_empty()) {
        let word =
            rest.bytes().take_while(|byte| byte.is_ascii_alphanumeric() || *byte == b'_' || *byte >= 128).count();
        let hashes = rest[word..].bytes().take_while(|byte| *byte == b'#').count();
        let is_raw = ["r", "br"].contains(&&rest[..word]) && rest[word + hashes..].starts_with('"');
        at = match rest.as_bytes()[0] {
            _ if is_raw => find(at + word + hashes + 1, &format!("\"{}", "#".repeat(hashes))),
            b'/' if rest.starts_with("//") => find(at, "\n"),
            b'"' => {
                let mut end = at + 1;
                while source.as_bytes()[end] != b'"' {
                    end += if source.as_bytes()[end] == b'\\' { 2 } else { 1 };
                }
                end + 1
            }
            b'\'' if rest[1..].starts_with('\\') => find(at + 3, "'"),
            b'\'' if rest[1..].chars().nth(1) == Some('\'') => find(at + 1, "'"),
            byte if byte.is_ascii_whitespace() => at + 1,
            _ => {
                tokens.push(&rest[..if rest.starts_with("::") { 2 } else { word.max(1) }]);
                at + tokens.last().map_or(1, |token| token.len())
            }
        };
    }
    tokens
}

/// The index after the group that starts at `start` with a bracket.
fn group_end(tokens: &[&str], start: usize) -> usize {
    let mut depth = 0;
    let ends = |token: &&str| {
        depth += i32::from(["(", "[", "{"].contains(token)) - i32::from([")", "]", "}"].contains(token));
        depth == 0
    };
    tokens[start..].iter().position(ends).map_or(tokens.len(), |at| start + at + 1)
}

/// The parts outside of tests, and the names of the modules for tests that have files of their own.
fn without_tests<'s>(tokens: &[&'s str]) -> (Vec<&'s str>, Vec<&'s str>) {
    let (mut code, mut test_modules, mut at) = (Vec::new(), Vec::new(), 0);
    while at < tokens.len() {
        let is_cfg = tokens[at..].starts_with(&["#", "[", "cfg", "("]) && tokens[at + 4] != "not";
        if !is_cfg || !tokens[at + 4..group_end(tokens, at + 1)].contains(&"test") {
            code.push(tokens[at]);
            at += 1;
            continue;
        }
        while tokens[at] == "#" {
            at = group_end(tokens, at + 1);
        }
        while !["{", ";"].contains(&tokens[at]) {
            at = if ["(", "["].contains(&tokens[at]) { group_end(tokens, at) } else { at + 1 };
        }
        if tokens[at - 2] == "mod" && tokens[at] == ";" {
            test_modules.push(tokens[at - 1]);
        }
        at = group_end(tokens, at).max(at + 1);
    }
    (code, test_modules)
}

/// The paths of a tree of names such as `a::{b, c::d}` at the start of the code, each behind `base`.
fn paths(code: &[&str], base: &str) -> Vec<String> {
    let (mut all, mut path, mut groups) = (Vec::new(), base.to_owned(), Vec::new());
    for (at, token) in code.iter().enumerate() {
        match *token {
            "{" => groups.push(path.len()),
            "}" => path.truncate(groups.pop().unwrap_or_default()),
            "," => path.truncate(groups.last().copied().unwrap_or_default()),
            "::" | "*" => continue,
            name => {
                path = if path.is_empty() { name.to_owned() } else { format!("{path}/{name}") };
                all.push(path.clone());
            }
        }
        if groups.is_empty() && code.get(at + 1) != Some(&"::") {
            break;
        }
    }
    all
}

/// All paths from `crate` or `super` in the code of a module.
fn used_paths(code: &[&str], module: &str) -> Vec<String> {
    let mut all = Vec::new();
    for at in (0..code.len()).filter(|at| !code[..*at].ends_with(&["::"])) {
        let supers = code[at..].chunks(2).take_while(|two| *two == ["super", "::"]).count();
        let base = (0..supers).fold(module, |base, _| base.rsplit_once('/').unwrap_or_default().0);
        if code[at..].starts_with(&["crate", "::"]) {
            all.extend(paths(&code[at + 2..], ""));
        } else if supers > 0 {
            all.extend(paths(&code[at + 2 * supers..], base));
        }
    }
    all
}

/// The path of a file's module: `a/b` for `a/b.rs` and `a/b/mod.rs`, nothing for the crate's root.
fn module_of(file: &str) -> &str {
    let path = file.trim_end_matches(".rs");
    if ["lib", "main"].contains(&path) { "" } else { path.trim_end_matches("/mod") }
}

/// The module below the crate's root that a path leads into.
fn top(path: &str) -> &str {
    path.split('/').next().unwrap()
}

/// Reads the files below a folder.
fn read(folder: &Path, below: &str, all: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(folder.join(below)).unwrap().map(Result::unwrap) {
        let name = format!("{below}{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            read(folder, &format!("{name}/"), all);
        } else if name.ends_with(".rs") {
            all.push((name, std::fs::read_to_string(entry.path()).unwrap()));
        }
    }
}

/// The imports of a crate's modules, without those of tests.
fn imports(sources: &[(String, String)]) -> Vec<Import> {
    let (mut files, mut tests) = (Vec::new(), Vec::new());
    for (file, source) in sources {
        let (code, test_modules) = without_tests(&tokens(source));
        tests.extend(test_modules.iter().map(|name| format!("/{}/{name}/", module_of(file)).replace("//", "/")));
        files.push((file.as_str(), code));
    }
    let is_test = |module: String| module.ends_with("_tests/") || tests.iter().any(|test| module.starts_with(test));
    files.retain(|(file, _)| !is_test(format!("/{}/", module_of(file))));
    let tops: BTreeSet<&str> = files.iter().map(|(file, _)| top(module_of(file))).collect();
    // Names that the crate's root takes from a module stand for it.
    let mut named = BTreeMap::new();
    for (_, code) in files.iter().filter(|(file, _)| module_of(file).is_empty()) {
        let paths = code.split(|token| *token == "use").skip(1).flat_map(|tree| paths(tree, ""));
        named.extend(paths.filter_map(|path| Some((path.rsplit_once('/')?.1.to_owned(), top(&path).to_owned()))));
    }
    let resolved = |path: String| if tops.contains(top(&path)) { Some(path) } else { named.get(top(&path)).cloned() };
    let of_file = |(file, code): &(&str, Vec<&str>)| -> Vec<Import> {
        let used = used_paths(code, module_of(file)).into_iter().filter_map(resolved);
        used.filter(|path| tops.contains(top(path))).map(|path| ((*file).to_owned(), path)).collect()
    };
    files.iter().filter(|(file, _)| !module_of(file).is_empty()).flat_map(of_file).collect()
}

/// The imports of which circles of top-level modules consist, and what leads from one circle to another.
fn circles(imports: &[Import]) -> Vec<&Import> {
    let tops = |(file, path): &&Import| (top(module_of(file)).to_owned(), top(path).to_owned());
    let mut left: Vec<&Import> = imports.iter().filter(|import| tops(import).0 != tops(import).1).collect();
    loop {
        let (users, used): (BTreeSet<_>, BTreeSet<_>) = left.iter().map(tops).unzip();
        if left.extract_if(.., |i| !used.contains(&tops(i).0) || !users.contains(&tops(i).1)).count() == 0 {
            return left;
        }
    }
}

/// The rows of a table of ARCHITECTURE.md: each module with the number of its row.
fn rows<'p>(page: &'p str, sentence: &str) -> BTreeMap<&'p str, usize> {
    let (_, rest) = page.split_once(sentence).unwrap_or_else(|| panic!("ARCHITECTURE.md lacks {sentence:?}"));
    let table = rest.trim_start().lines().take_while(|line| line.starts_with('|'));
    let cells = table.map(|line| line.split('|').nth(1).unwrap()).enumerate();
    cells.flat_map(|(row, cell)| cell.split('`').skip(1).step_by(2).map(move |word| (word, row))).collect()
}

/// The imports that go down a table, whose rows are for the longest part of a path. A module may use what it contains.
fn downward<'i>(imports: &'i [Import], rows: &BTreeMap<&str, usize>) -> Vec<&'i Import> {
    fn row<'a>(path: &'a str, rows: &BTreeMap<&str, usize>) -> (&'a str, usize) {
        let parts = path.match_indices('/').map(|(end, _)| &path[..end]).chain([path]);
        parts.rev().find_map(|part| Some((part, *rows.get(part)?))).unwrap_or_else(|| panic!("{path} has no row"))
    }
    let is_downward = |(file, path): &&Import| {
        let ((from, own), (to, other)) = (row(module_of(file), rows), row(path, rows));
        other > own && !to.starts_with(&format!("{from}/"))
    };
    imports.iter().filter(is_downward).collect()
}

#[test]
fn modules_use_only_modules_above_them() {
    let page = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    for entry in std::fs::read_dir(root().join("crates")).unwrap().map(Result::unwrap) {
        let (name, mut sources) = (entry.file_name().into_string().unwrap(), Vec::new());
        read(&entry.path().join("src"), "", &mut sources);
        let imports = imports(&sources);
        assert!(name != "canaletto" || imports.len() > 1000, "{}", imports.len());
        assert!(circles(&imports).is_empty(), "modules of {name} form a circle: {:#?}", circles(&imports));
        if let Some((_, sentence)) = TABLES.iter().find(|(of, _)| *of == name) {
            let down = downward(&imports, &rows(&page, sentence));
            assert!(down.is_empty(), "modules of {name} use modules below them: {down:#?}");
        }
    }
}

#[test]
fn planted_imports_are_seen() {
    let planted = |source: &str| {
        let files = [("a/mod.rs", source), ("b.rs", "use crate::a::T;"), ("lib.rs", "pub use b::{X, Y};")];
        imports(&files.map(|(name, source)| (name.to_owned(), source.to_owned())))
    };
    let hidden = r##"
        // use crate::b::T;
        const T: &str = "use crate::b::T; \"";
        const R: &str = r#"" use crate::b::T;"#;
        use self::b::T;
        #[cfg(test)] #[allow(x)] mod tests { use crate::b::T; }
        #[cfg(all(test, unix))] use crate::b::T;
    "##;
    assert!(circles(&planted(hidden)).is_empty());
    for source in
        ["use crate::b::T;", "use super::{c, b};", "fn f() { crate::b::g::<1>(b'\"') }", "use crate::{c::{d}, Y};"]
    {
        assert!(!circles(&planted(&[hidden, source].concat())).is_empty(), "{source}");
    }
    let rows = rows("It holds.\n\n| module |\n|---|\n| `a` |\n| `b`, `c` |\n| `a/d` |\n", "It holds.");
    assert_eq!(downward(&planted("use crate::b::T;"), &rows)[0].0, "a/mod.rs");
    assert!(downward(&planted("use super::a::d::T;"), &rows).is_empty());
}
