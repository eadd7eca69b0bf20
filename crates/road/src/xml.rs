//! XML from outside, with bounds: nothing that a parser takes more than linear time or memory for.
//!
//! `roxmltree` compares every attribute of an element with all others of it: one element with
//! 200,000 of them takes minutes. What it would be given is looked over first, in one pass.

use alloc::format;
use alloc::string::{String, ToString};

use roxmltree::{Document, ParsingOptions};

/// Larger files are refused, bytes.
pub const MAX_BYTES: u64 = 128 << 20;
/// Most elements, attributes not counted.
const MAX_NODES: u32 = 20_000_000;
/// Most attributes of one element; OpenDRIVE and CommonRoad have fewer than twenty.
const MAX_ATTRIBUTES: usize = 256;
/// Most elements inside each other; OpenDRIVE and CommonRoad have fewer than ten.
const MAX_DEPTH: usize = 128;

/// Why a text is not taken as XML.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {why}")]
pub struct XmlError {
    /// Line, from 1.
    pub line: u32,
    /// What is wrong.
    pub why: String,
}

/// Parses a text within the bounds.
///
/// # Errors
/// [`XmlError`] with the line: no XML, a document type definition, or more than the bounds allow.
pub fn parse(text: &str) -> Result<Document<'_>, XmlError> {
    if text.len() as u64 > MAX_BYTES {
        let why = format!("{} bytes, at most {MAX_BYTES} are read", text.len());
        return Err(XmlError { line: 1, why });
    }
    look_over(text.as_bytes())?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
        .map_err(|e| XmlError { line: e.pos().row, why: e.to_string() })
}

/// Counts attributes and depth. What is not well-formed is left to the parser.
fn look_over(text: &[u8]) -> Result<(), XmlError> {
    let (mut at, mut depth) = (0, 0_usize);
    let too_many = |at: usize, why: String| {
        let before = text.get(..at).unwrap_or_default();
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        Err(XmlError { line: u32::try_from(line).unwrap_or(u32::MAX), why })
    };
    while let Some(begin) = find(text, at, b"<") {
        let rest = text.get(begin..).unwrap_or_default();
        let end = match rest {
            [b'<', b'!', b'-', b'-', ..] => find(text, begin + 4, b"-->"),
            [b'<', b'!', b'[', ..] => find(text, begin, b"]]>"),
            [b'<', b'?', ..] => find(text, begin, b"?>"),
            [b'<', b'!', ..] => find(text, begin, b">"),
            [b'<', b'/', ..] => {
                depth = depth.saturating_sub(1);
                find(text, begin, b">")
            }
            _ => {
                let Some(tag) = Tag::read(rest) else { return Ok(()) };
                if tag.attributes > MAX_ATTRIBUTES {
                    let many = tag.attributes;
                    let why = format!(
                        "an element with {many} attributes, at most {MAX_ATTRIBUTES} are read"
                    );
                    return too_many(begin, why);
                }
                depth += usize::from(!tag.is_empty);
                if depth > MAX_DEPTH {
                    let why = format!("more than {MAX_DEPTH} elements inside each other");
                    return too_many(begin, why);
                }
                Some(begin + tag.bytes - 1)
            }
        };
        let Some(end) = end else { return Ok(()) };
        at = end + 1;
    }
    Ok(())
}

/// Where a pattern stands next.
fn find(text: &[u8], from: usize, pattern: &[u8]) -> Option<usize> {
    let (first, rest) = pattern.split_first()?;
    let mut at = from;
    loop {
        at += text.get(at..)?.iter().position(|b| b == first)?;
        if text.get(at + 1..).is_some_and(|t| t.starts_with(rest)) {
            return Some(at);
        }
        at += 1;
    }
}

/// The tag that opens an element.
struct Tag {
    /// Its length with both brackets.
    bytes: usize,
    attributes: usize,
    /// `<a/>`: nothing is inside.
    is_empty: bool,
}

impl Tag {
    /// Reads up to the closing bracket; none if there is none.
    fn read(text: &[u8]) -> Option<Self> {
        let (mut quote, mut attributes) = (None, 0);
        for (i, &byte) in text.iter().enumerate() {
            match (quote, byte) {
                (Some(q), b) if b == q => quote = None,
                (None, b'"' | b'\'') => {
                    quote = Some(byte);
                    attributes += 1;
                }
                (None, b'>') => {
                    let is_empty = i > 0 && text.get(i - 1) == Some(&b'/');
                    return Some(Self { bytes: i + 1, attributes, is_empty });
                }
                _ => {}
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::String;

    fn attributes(count: usize) -> String {
        let list: String = (0..count).map(|i| format!(" a{i}=\"{i}\"")).collect();
        format!("<map>\n<road{list}/>\n</map>")
    }

    /// A map with 200,000 attributes on one element gave no answer in two minutes.
    #[test]
    fn an_element_with_many_attributes_is_refused_at_once_with_its_line() {
        assert!(parse(&attributes(256)).is_ok());
        for count in [257, 200_000] {
            let e = parse(&attributes(count)).unwrap_err();
            assert_eq!(e.line, 2);
            assert!(e.why.contains(&format!("{count} attributes")), "{e}");
        }
    }

    #[test]
    fn elements_inside_each_other_are_bounded() {
        let nested = |n: usize| "<a>".repeat(n) + &"</a>".repeat(n);
        assert!(parse(&nested(128)).is_ok());
        assert!(parse(&nested(129)).unwrap_err().why.contains("inside each other"));
        assert!(parse(&nested(1_000_000)).is_err());
        let siblings = format!("<a>{}</a>", "<b/><c></c>".repeat(1000));
        assert!(parse(&siblings).is_ok());
    }

    #[test]
    fn quotes_comments_and_character_data_are_not_counted() {
        let quoted = "a=\"1\" ".repeat(300);
        for text in [
            format!("<a><!-- <b {quoted}> --></a>"),
            format!("<a><![CDATA[<b {quoted}>]]></a>"),
            format!("<a>{quoted}</a>"),
            format!("<a x='>{}'/>", "\"\"".repeat(300)),
            format!("<?xml version=\"1.0\"?><?pi {quoted}?><a/>"),
        ] {
            assert!(parse(&text).is_ok(), "{text}");
        }
    }

    #[test]
    fn what_is_not_well_formed_is_left_to_the_parser() {
        for text in ["", "<", "<a", "<a b=\"", "<a b=\"1\" b=\"2\"/>", "<!-- ", "<![CDATA[", "</a>"]
        {
            assert!(parse(text).is_err(), "{text}");
        }
        assert!(parse("<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>").is_err());
    }
}
