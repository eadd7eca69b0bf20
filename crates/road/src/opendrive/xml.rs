//! Attribute access that names file, line and element when a value cannot be used.

use roxmltree::Node;

use crate::RoadError;

/// Larger numbers are taken for a mistake: no map reaches them.
const LARGEST: f64 = 1e9;

/// The file: its name for errors, and where its lines begin.
pub(super) struct Source<'a> {
    name: &'a str,
    line_starts: Vec<usize>,
}

impl<'a> Source<'a> {
    pub(super) fn new(name: &'a str, text: &str) -> Self {
        Self { name, line_starts: text.match_indices('\n').map(|(i, _)| i + 1).collect() }
    }

    /// Line of an element, from 1.
    pub(super) fn line(&self, node: Node<'_, '_>) -> u32 {
        1 + self.line_starts.partition_point(|&i| i <= node.range().start) as u32
    }

    pub(super) fn error(&self, node: Node<'_, '_>, why: impl Into<String>) -> RoadError {
        RoadError::OpenDrive {
            path: self.name.into(),
            line: self.line(node),
            element: node.tag_name().name().into(),
            why: why.into(),
        }
    }

    /// A text attribute that must be there.
    pub(super) fn text<'n>(&self, node: Node<'n, '_>, key: &str) -> Result<&'n str, RoadError> {
        node.attribute(key).ok_or_else(|| self.error(node, format!("{key} is missing")))
    }

    /// A finite number that must be there.
    pub(super) fn number(&self, node: Node<'_, '_>, key: &str) -> Result<f64, RoadError> {
        let text = self.text(node, key)?;
        let value = text.trim().parse::<f64>().ok().filter(|v| v.abs() <= LARGEST);
        value.ok_or_else(|| self.error(node, format!("{key} = {text:?} is not a usable number")))
    }

    /// A number that must not be negative.
    pub(super) fn length(&self, node: Node<'_, '_>, key: &str) -> Result<f64, RoadError> {
        let value = self.number(node, key)?;
        if value < 0.0 {
            return Err(self.error(node, format!("{key} = {value} is negative")));
        }
        Ok(value)
    }

    /// A whole number that must be there.
    pub(super) fn integer(&self, node: Node<'_, '_>, key: &str) -> Result<i32, RoadError> {
        let text = self.text(node, key)?;
        let value = text.trim().parse::<i32>().ok().filter(|v| v.abs() <= 10_000);
        value.ok_or_else(|| self.error(node, format!("{key} = {text:?} is not a whole number")))
    }

    /// The cubic `a + b ds + c ds² + d ds³` of a record, with the given attribute suffix.
    pub(super) fn cubic(&self, node: Node<'_, '_>, suffix: &str) -> Result<[f64; 4], RoadError> {
        let mut out = [0.0; 4];
        for (value, letter) in out.iter_mut().zip(["a", "b", "c", "d"]) {
            *value = self.number(node, &format!("{letter}{suffix}"))?;
        }
        Ok(out)
    }
}

/// Child elements of one name.
pub(super) fn children<'a, 'i>(
    node: Node<'a, 'i>,
    name: &'a str,
) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |c| c.is_element() && c.tag_name().name() == name)
}

/// The first child element of a name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &'a str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}
