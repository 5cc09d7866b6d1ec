//! A matrix in a file of OpenCV's FileStorage: its shape and elements, checked.

use super::tree::Node;

/// Most elements of a matrix; the largest of a model are 14 coefficients of distortion.
const MAX_ELEMENTS: usize = 64;

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
    pub fn read(name: &str, node: &Node) -> Result<Self, String> {
        let no_matrix = || format!("{name} is not a matrix: write it as one with cv2.FileStorage");
        let (shape, elements) = match node {
            Node::Map(_) => {
                let whole = |key: &str| {
                    let Some(Node::Value(text)) = node.get(key) else {
                        return Err(format!("{name} has no {key}: write it as a matrix"));
                    };
                    let number = text.trim().parse::<usize>().ok();
                    number.ok_or_else(|| {
                        format!("{name} has {key} {text:?}: a whole number is needed")
                    })
                };
                if let Some(Node::Value(kind)) = node.get("dt")
                    && !matches!(kind.as_str(), "d" | "f" | "i" | "1d" | "1f" | "1i")
                {
                    return Err(format!(
                        "{name} has elements of type {kind:?}: write one channel of doubles (dt: d)"
                    ));
                }
                let data = node
                    .get("data")
                    .ok_or_else(|| format!("{name} has no data: write it as a matrix"))?;
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
                    return Err(format!(
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
            return Err(format!(
                "{name} has {} elements: no matrix of a model has more than {MAX_ELEMENTS}",
                elements.len()
            ));
        }
        if shape.0.checked_mul(shape.1) != Some(elements.len()) {
            return Err(format!(
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
    ) -> Result<[f64; N], String> {
        let as_row = columns == 1 && self.shape == (1, rows);
        let right = self.shape == (rows, columns) || as_row;
        let numbers = <[f64; N]>::try_from(self.numbers.as_slice());
        numbers.ok().filter(|_| right).ok_or_else(|| {
            format!(
                "{name} is {}×{}: it must be {rows}×{columns}",
                self.shape.0, self.shape.1
            )
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
fn number(name: &str, word: &str) -> Result<f64, String> {
    let not_finite = || {
        format!(
            "{name} holds {word}, which is not finite: the calibration did not converge, take more and \
             sharper pictures of the board"
        )
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
            _ => Err(format!("{name} holds {word:?}, which is not a number")),
        },
    }
}
