//! A file of OpenCV's FileStorage, written in YAML, XML or JSON: its tree of names and values, and the
//! matrices in it.
//!
//! JSON is read as YAML, which includes it, so that the `.Nan` that OpenCV writes into JSON is read
//! too. Aliases of YAML and document types of XML are refused: OpenCV writes none, and with them a
//! few lines expand to gigabytes.

use super::wrong;
use crate::error::{Exit, Result};
use saphyr_parser::{Event, Parser};

/// Largest file, bytes. A model of two devices takes 3 kB; what is larger holds pictures.
pub const MAX_BYTES: u64 = 1 << 20;
/// Deepest nesting. OpenCV needs three.
const MAX_DEPTH: usize = 16;
/// Most elements of a matrix; the largest of a model are 14 coefficients of distortion.
const MAX_ELEMENTS: usize = 64;

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
pub fn read(bytes: &[u8]) -> Result<Node> {
    let text = std::str::from_utf8(bytes).map_err(|_| wrong("it is not a text file: unpack it if it is compressed; cv2.FileStorage writes .yml, .xml or .json"))?;
    let text = text.trim_start_matches('\u{feff}');
    let node = if text.trim_start().starts_with('<') {
        xml(text)?
    } else {
        yaml(text)?
    };
    match node {
        Node::Map(_) => Ok(node),
        _ => Exit::Content.fail("it names no values: write the models with cv2.FileStorage"),
    }
}

/// A list or map that is being read; a map with the name whose value comes next.
enum OpenNode {
    List(Vec<Node>),
    Map(Vec<(String, Node)>, Option<String>),
}

fn yaml(text: &str) -> Result<Node> {
    // OpenCV 4 writes "%YAML:1.0", which is not a valid YAML directive.
    let text = match text.strip_prefix("%YAML:") {
        Some(rest) => rest.split_once('\n').map_or("", |(_, rest)| rest),
        None => text,
    };
    let mut open: Vec<OpenNode> = Vec::new();
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(|error| {
            wrong(format!(
                "it is neither YAML nor JSON nor XML: {error}: write it with cv2.FileStorage"
            ))
        })?;
        let line = span.start.line();
        let done = match event {
            Event::Scalar(value, ..) => Node::Value(value.into_owned()),
            Event::SequenceStart(..) => {
                open.push(OpenNode::List(Vec::new()));
                deep(open.len(), line)?;
                continue;
            }
            Event::MappingStart(..) => {
                open.push(OpenNode::Map(Vec::new(), None));
                deep(open.len(), line)?;
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(OpenNode::List(all)) => Node::List(all),
                Some(OpenNode::Map(all, _)) => Node::Map(all),
                None => {
                    return Exit::Content
                        .fail(format!("line {line}: something ends that did not begin"));
                }
            },
            Event::Alias(_) => {
                return Exit::Content.fail(format!(
                    "line {line}: an alias (*): write the value itself, as cv2.FileStorage does"
                ));
            }
            _ => continue,
        };
        match open.last_mut() {
            // The first document is the whole file.
            None => return Ok(done),
            Some(OpenNode::List(all)) => all.push(done),
            Some(OpenNode::Map(all, waiting)) => match (waiting.take(), done) {
                (None, Node::Value(name)) => *waiting = Some(name),
                (None, _) => {
                    return Exit::Content.fail(format!(
                        "line {line}: a name that is not a word: write it with cv2.FileStorage"
                    ));
                }
                (Some(name), done) => put(all, name, done, line)?,
            },
        }
    }
    Exit::Content.fail("it is empty: write the models with cv2.FileStorage")
}

fn deep(depth: usize, line: usize) -> Result<()> {
    if depth > MAX_DEPTH {
        return Exit::Content.fail(format!(
            "line {line}: nested more than {MAX_DEPTH} deep: leave in it only what calibration needs"
        ));
    }
    Ok(())
}

fn put(all: &mut Vec<(String, Node)>, name: String, node: Node, line: usize) -> Result<()> {
    if all.iter().any(|(known, _)| *known == name) {
        return Exit::Content.fail(format!(
            "line {line}: {name} is there twice: leave one of them"
        ));
    }
    all.push((name, node));
    Ok(())
}

fn xml(text: &str) -> Result<Node> {
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
            wrong("it has a document type (<!DOCTYPE), which OpenCV does not write: remove it")
        }
        error => wrong(format!(
            "it is not valid XML: {error}: write it with cv2.FileStorage"
        )),
    })?;
    let root = document.root_element();
    let line =
        |node: &roxmltree::Node<'_, '_>| document.text_pos_at(node.range().start).row as usize;
    element(&root, &line)
}

fn element(
    node: &roxmltree::Node<'_, '_>,
    line: &dyn Fn(&roxmltree::Node<'_, '_>) -> usize,
) -> Result<Node> {
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

/// A matrix, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Rows and columns; a plain list is one row.
    pub shape: (usize, usize),
    /// The numbers, row by row, all finite.
    pub numbers: Vec<f64>,
}

impl Matrix {
    /// Reads a matrix; `name` is only for messages.
    ///
    /// # Errors
    /// In words: it is not a matrix, its number of elements contradicts its shape, or one is not
    /// finite.
    pub fn read(name: &str, node: &Node) -> Result<Self> {
        let no_matrix = || {
            wrong(format!(
                "{name} is not a matrix: write it as one with cv2.FileStorage"
            ))
        };
        let (shape, elements) = match node {
            Node::Map(_) => {
                let whole = |key: &str| {
                    let Some(Node::Value(text)) = node.get(key) else {
                        return Exit::Content
                            .fail(format!("{name} has no {key}: write it as a matrix"));
                    };
                    let number = text.trim().parse::<usize>().ok();
                    number.ok_or_else(|| {
                        wrong(format!(
                            "{name} has {key} {text:?}: a whole number is needed"
                        ))
                    })
                };
                if let Some(Node::Value(kind)) = node.get("dt")
                    && !matches!(kind.as_str(), "d" | "f" | "i" | "1d" | "1f" | "1i")
                {
                    return Exit::Content.fail(format!(
                        "{name} has elements of type {kind:?}: write one channel of doubles (dt: d)"
                    ));
                }
                let data = node
                    .get("data")
                    .ok_or_else(|| wrong(format!("{name} has no data: write it as a matrix")))?;
                (
                    (whole("rows")?, whole("cols")?),
                    words(data).ok_or_else(no_matrix)?,
                )
            }
            // Rows in a list, as Python's yaml.dump and json.dump write an array.
            Node::List(rows) if rows.iter().any(|row| matches!(row, Node::List(_))) => {
                let rows: Option<Vec<_>> = rows.iter().map(words).collect();
                let rows = rows.ok_or_else(no_matrix)?;
                let columns = rows[0].len();
                if rows.iter().any(|row| row.len() != columns) {
                    return Exit::Content.fail(format!(
                        "{name} has rows of different lengths: write it anew"
                    ));
                }
                ((rows.len(), columns), rows.concat())
            }
            list => {
                let elements = words(list).ok_or_else(no_matrix)?;
                ((1, elements.len()), elements)
            }
        };
        if elements.len() > MAX_ELEMENTS {
            return Exit::Content.fail(format!(
                "{name} has {} elements: no matrix of a model has more than {MAX_ELEMENTS}",
                elements.len()
            ));
        }
        if shape.0.checked_mul(shape.1) != Some(elements.len()) {
            return Exit::Content.fail(format!(
                "{name} says {}×{} and holds {} numbers: the file was cut or edited, write it anew",
                shape.0,
                shape.1,
                elements.len()
            ));
        }
        let numbers = elements
            .iter()
            .map(|word| number(name, word))
            .collect::<Result<_, _>>()?;
        Ok(Self { shape, numbers })
    }

    /// Its numbers if it has this shape; a column may also be written as a row.
    ///
    /// # Errors
    /// In words, with both shapes.
    pub fn expect<const N: usize>(
        &self,
        name: &str,
        (rows, columns): (usize, usize),
    ) -> Result<[f64; N]> {
        let as_row = columns == 1 && self.shape == (1, rows);
        let right = self.shape == (rows, columns) || as_row;
        let numbers = <[f64; N]>::try_from(self.numbers.as_slice());
        numbers.ok().filter(|_| right).ok_or_else(|| {
            wrong(format!(
                "{name} is {}×{}: it must be {rows}×{columns}",
                self.shape.0, self.shape.1
            ))
        })
    }

    /// Whether it is a row or a column.
    pub fn is_vector(&self) -> bool {
        self.shape.0 == 1 || self.shape.1 == 1
    }
}

/// The words of a matrix's data: a list of them, or in XML one text.
fn words(node: &Node) -> Option<Vec<&str>> {
    match node {
        Node::Value(text) => Some(text.split_whitespace().collect()),
        Node::List(all) => all
            .iter()
            .map(|node| match node {
                Node::Value(word) => Some(word.as_str()),
                _ => None,
            })
            .collect(),
        Node::Map(_) => None,
    }
}

/// A finite number.
fn number(name: &str, word: &str) -> Result<f64> {
    let not_finite = || {
        wrong(format!(
            "{name} holds {word}, which is not finite: the calibration did not converge, take more and \
             sharper pictures of the board"
        ))
    };
    match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(_) => Err(not_finite()),
        Err(_) => match word
            .trim_start_matches(['-', '+', '.'])
            .to_ascii_lowercase()
            .as_str()
        {
            "nan" | "inf" => Err(not_finite()),
            _ => Exit::Content.fail(format!("{name} holds {word:?}, which is not a number")),
        },
    }
}
