use super::{MAX_DEPTH, Node, ValueKind, parse};
use crate::text::files::Files;
use crate::text::report::Report;

fn read(text: &str) -> Result<Vec<Node>, String> {
    let mut report = Report::default();
    let nodes = parse(text, 0, false, &mut report);
    if report.has_errors() { Err(report.finish(&Files::default()).to_string()) } else { Ok(nodes.unwrap_or_default()) }
}

/// Writes the tree as text in a canonical form.
fn show(nodes: &[Node], out: &mut String) {
    use std::fmt::Write;
    let kind = |kind: &ValueKind| match kind {
        ValueKind::Number(number) => format!("{number}"),
        ValueKind::Text(text) => format!("{text:?}"),
        ValueKind::Flag(flag) => format!("#{flag}"),
        ValueKind::Null => "#null".into(),
    };
    for node in nodes {
        let _ = write!(out, "{:?}", node.name);
        node.values.iter().for_each(|v| _ = write!(out, " {}", kind(&v.kind)));
        node.properties.iter().for_each(|p| _ = write!(out, " {:?}={}", p.key, kind(&p.value.kind)));
        out.push_str(" { ");
        show(&node.children, out);
        out.push_str("} ");
    }
}

fn shown(text: &str) -> String {
    let mut out = String::new();
    match read(text) {
        Ok(nodes) => show(&nodes, &mut out),
        Err(message) => out = message,
    }
    out
}

#[test]
fn nodes_have_values_properties_and_blocks() {
    let text = "a 1 \"two\" k=3 { b; c #true }; d\ne /-5 6 /- { x } { y } /-{ z }\n/-gone 1 { f }\n";
    assert_eq!(shown(text), "\"a\" 1 \"two\" \"k\"=3 { \"b\" { } \"c\" #true { } } \"d\" { } \"e\" 6 { \"y\" { } } ");
}

#[test]
fn comments_and_continued_lines_are_blank() {
    assert_eq!(shown("a /* x /* y */ */ 1 \\ // more\n  2 // end\n/- b {\n}\nc"), "\"a\" 1 2 { } \"c\" { } ");
    assert_eq!(shown("\u{feff}a"), "\"a\" { } ");
}

#[test]
fn texts_of_every_form() {
    assert_eq!(
        shown(r##"a "x\n\"\u{e9}\s" #"\raw"# -x .. "a\   b""##),
        "\"a\" \"x\\n\\\"é \" \"\\\\raw\" \"-x\" \"..\" \"ab\" { } "
    );
    assert_eq!(shown("a \"\"\"\n  one\n\n    two\\n\n  \"\"\""), "\"a\" \"one\\n\\n  two\\n\" { } ");
    assert_eq!(shown("a #\"\"\"\n\tx\\\n\t\"\"\"#"), "\"a\" \"x\\\\\" { } ");
}

#[test]
fn every_mistake_is_reported_with_its_place() {
    let text = "a 1, 2\nb = 3\nc (u8)4\nd true\ne x/y\nf .5\n}\ng";
    let message = read(text).unwrap_err();
    assert_eq!(message.matches("error:").count(), 7, "{message}");
    for part in [
        "without commas: 1",
        "no = stands",
        "has no ( )",
        "write #true",
        "a path stands in quotes",
        "-0.5",
        "closes nothing",
    ] {
        let part = if part == "-0.5" { "a 0 before the point: 0.5" } else { part };
        assert!(message.contains(part), "{part} in {message}");
    }
}

#[test]
fn hostile_nesting_ends_quickly() {
    for (open, close) in [
        ("a {", "}"),
        ("{", "}"),
        ("a /- {", "}"),
        ("/- a {", "}"),
        ("/*", "*/"),
        ("}", "{"),
        ("(", ")"),
        ("a \"\"\"", ""),
        ("a /-", ""),
        ("a=", ""),
        ("(;", ""),
        ("a (;", ""),
        ("\"\n", ""),
        ("#\"\n", ""),
        ("#", ""),
        ("a #", ""),
        ("a\\", ""),
        ("/-;", ""),
        ("{;", ""),
        ("1;", ""),
        ("é", ""),
    ] {
        let text = format!("{}{}", open.repeat(200_000), close.repeat(200_000));
        let start = std::time::Instant::now();
        let _ = read(&text);
        let time = start.elapsed().as_secs_f64();
        assert!(time < 5.0, "{open} took {time} s");
        let fits = format!("{}{}", open.repeat(MAX_DEPTH), close.repeat(MAX_DEPTH));
        if open.starts_with('a') && open.ends_with('{') {
            assert!(read(&fits).is_ok(), "{open}");
        }
    }
}

mod like_the_kdl_crate {
    use super::*;
    use kdl::{KdlDocument, KdlNode, KdlValue};
    use proptest::prelude::*;

    fn show_theirs(document: &KdlDocument, out: &mut String) {
        use std::fmt::Write;
        let kind = |value: &KdlValue| match value {
            KdlValue::Integer(number) => format!("{}", *number as f64),
            KdlValue::Float(number) => format!("{number}"),
            KdlValue::String(text) => format!("{text:?}"),
            KdlValue::Bool(flag) => format!("#{flag}"),
            KdlValue::Null => "#null".into(),
        };
        for node in document.nodes() {
            let node: &KdlNode = node;
            let _ = write!(out, "{:?}", node.name().value());
            for entry in node.entries().iter().filter(|e| e.name().is_none()) {
                let _ = write!(out, " {}", kind(entry.value()));
            }
            for entry in node.entries() {
                if let Some(name) = entry.name() {
                    let _ = write!(out, " {:?}={}", name.value(), kind(entry.value()));
                }
            }
            out.push_str(" { ");
            if let Some(children) = node.children() {
                show_theirs(children, out);
            }
            out.push_str("} ");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..crate::testing::seeded() })]

        /// Texts that the `kdl` crate accepts have equal trees here.
        #[test]
        fn accepted_texts_mean_the_same(parts in prop::collection::vec(prop::sample::select(vec![
            "a", "b2", "-x", "\"q\"", "\"e\\n\"", "#\"r\"#", "1", "-2.5", "+1e3", "0x1F", "1_0", "#true", "#null", "k=1", "k=\"v\"",
            " ", " ", " ", " ", "\n", ";", "{", "}", " {", "/-", "// c\n", "/* c */", "\\\n", "\"\"\"\n x\n  y\n \"\"\"", "\r\n", "=", "\t",
        ]), 0..24)) {
            let text = parts.concat();
            // The crate takes exponential time for nested commented-out blocks.
            prop_assume!(text.matches("/-").count() < 5);
            if let Ok(document) = KdlDocument::parse_v2(&text) {
                let mut theirs = String::new();
                show_theirs(&document, &mut theirs);
                prop_assert_eq!(shown(&text), theirs, "{:?}", text);
            }
        }
    }
}
