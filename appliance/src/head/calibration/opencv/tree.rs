//! The tree of names and values in a file of OpenCV's FileStorage, written in YAML, XML or JSON.
//!
//! JSON is read as YAML, which includes it, so that the `.Nan` that OpenCV writes into JSON is read
//! too. Aliases of YAML and document types of XML are refused: OpenCV writes none, and with them a
//! few lines expand to gigabytes.

use saphyr_parser::{Event, Parser};

/// Largest file, bytes. A model of two devices takes 3 kB; what is larger holds pictures.
pub const MAX_BYTES: u64 = 1 << 20;
/// Deepest nesting. OpenCV needs three.
const MAX_DEPTH: usize = 16;

/// A value of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A word or a number, as it is written.
    Value(String),
    /// Values in their order.
    List(Vec<Node>),
    /// Values by name.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<&Self> {
        match self {
            Self::Map(all) => all
                .iter()
                .find(|(key, _)| key == name)
                .map(|(_, node)| node),
            _ => None,
        }
    }
}

/// Reads YAML, XML or JSON.
///
/// # Errors
/// In words: what is wrong with it and where, and what to do.
pub fn read(bytes: &[u8]) -> Result<Node, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| {
        "it is not a text file: unpack it if it is compressed; cv2.FileStorage writes .yml, .xml or .json"
            .to_owned()
    })?;
    let text = text.trim_start_matches('\u{feff}');
    let node = if text.trim_start().starts_with('<') {
        xml(text)?
    } else {
        yaml(text)?
    };
    match node {
        Node::Map(_) => Ok(node),
        _ => Err("it names no values: write the models with cv2.FileStorage".into()),
    }
}

/// A list or map that is being read; a map with the name whose value comes next.
enum Open {
    List(Vec<Node>),
    Map(Vec<(String, Node)>, Option<String>),
}

fn yaml(text: &str) -> Result<Node, String> {
    // OpenCV 4 writes "%YAML:1.0", which is not a valid YAML directive.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, rest)| rest),
        None => text,
    };
    let mut open: Vec<Open> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(|error| {
            format!("it is neither YAML nor JSON nor XML: {error}: write it with cv2.FileStorage")
        })?;
        let line = span.start.line();
        let done = match event {
            Event::Scalar(value, ..) => Node::Value(value.into_owned()),
            Event::SequenceStart(..) => {
                open.push(Open::List(Vec::new()));
                deep(open.len(), line)?;
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(Vec::new(), None));
                deep(open.len(), line)?;
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(all)) => Node::List(all),
                Some(Open::Map(all, _)) => Node::Map(all),
                None => return Err(format!("line {line}: something ends that did not begin")),
            },
            Event::Alias(_) => {
                return Err(format!(
                    "line {line}: an alias (*): write the value itself, as cv2.FileStorage does"
                ));
            }
            _ => continue,
        };
        match open.last_mut() {
            // The first document is the whole file.
            None => return Ok(done),
            Some(Open::List(all)) => all.push(done),
            Some(Open::Map(all, waiting)) => match (waiting.take(), done) {
                (None, Node::Value(name)) => *waiting = Some(name),
                (None, _) => {
                    return Err(format!(
                        "line {line}: a name that is not a word: write it with cv2.FileStorage"
                    ));
                }
                (Some(name), done) => put(all, name, done, line)?,
            },
        }
    }
    Err("it is empty: write the models with cv2.FileStorage".into())
}

fn deep(depth: usize, line: usize) -> Result<(), String> {
    if depth > MAX_DEPTH {
        return Err(format!(
            "line {line}: nested more than {MAX_DEPTH} deep: leave in it only what calibration needs"
        ));
    }
    Ok(())
}

fn put(all: &mut Vec<(String, Node)>, name: String, node: Node, line: usize) -> Result<(), String> {
    if all.iter().any(|(known, _)| *known == name) {
        return Err(format!(
            "line {line}: {name} is there twice: leave one of them"
        ));
    }
    all.push((name, node));
    Ok(())
}

fn xml(text: &str) -> Result<Node, String> {
    // The library recurses, so the depth is checked first.
    let (mut depth, mut deepest) = (0_usize, 0);
    for (at, _) in text.match_indices('<') {
        match text.as_bytes().get(at + 1) {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'?' | b'!') => {}
            _ => depth += 1,
        }
        deepest = deepest.max(depth);
    }
    deep(deepest, text.lines().count())?;
    let document = roxmltree::Document::parse(text).map_err(|error| match error {
        roxmltree::Error::DtdDetected => {
            "it has a document type (<!DOCTYPE), which OpenCV does not write: remove it".to_owned()
        }
        error => format!("it is not valid XML: {error}: write it with cv2.FileStorage"),
    })?;
    let root = document.root_element();
    let line =
        |node: &roxmltree::Node<'_, '_>| document.text_pos_at(node.range().start).row as usize;
    element(&root, &line)
}

fn element(
    node: &roxmltree::Node<'_, '_>,
    line: &dyn Fn(&roxmltree::Node<'_, '_>) -> usize,
) -> Result<Node, String> {
    let children: Vec<_> = node.children().filter(|child| child.is_element()).collect();
    if children.is_empty() {
        let text: String = node.children().filter_map(|child| child.text()).collect();
        return Ok(Node::Value(text.trim().trim_matches('"').to_owned()));
    }
    // OpenCV names the members of a list "_".
    if children.iter().all(|child| child.tag_name().name() == "_") {
        let all = children.iter().map(|child| element(child, line));
        return Ok(Node::List(all.collect::<Result<_, _>>()?));
    }
    let mut all = Vec::with_capacity(children.len());
    for child in &children {
        let name = child.tag_name().name().to_owned();
        put(&mut all, name, element(child, line)?, line(child))?;
    }
    Ok(Node::Map(all))
}
