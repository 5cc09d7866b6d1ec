//! Words: what `docs/words.md` says is not written is nowhere on the page, in a message or in a
//! document.

use crate::house::files_of;
use crate::names::CRATES;
use proc_macro2::{TokenStream, TokenTree};
use std::fs;
use std::path::{Path, PathBuf};
use tests::files;
use tests::shared::root;

/// The list of terms.
const LIST: &str = "docs/words.md";

/// Markdown that is not scanned: the list itself, and what names words that were replaced.
const EXCEPTED: [&str; 2] = [LIST, "CHANGELOG.md"];

/// The terms of the list, at least.
const TERMS: usize = 32;

/// Strings of messages, at least, and words of the page and of documents.
const STRINGS: usize = 5_000;
const WORDS: usize = 100_000;

/// A term, and what is not written in its place, each as its words.
struct Term {
    name: String,
    wrong: Vec<Vec<String>>,
}

/// A word in lower case, or `|` for a mark between words, and its line.
type Word = (usize, String);

/// The terms of a table with the columns term, meaning and what is not written.
fn terms(list: &str) -> Vec<Term> {
    let rows = list.lines().filter_map(|line| line.strip_prefix("| "));
    // Without the head of the table.
    let rows = rows.skip(1).map(|row| {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let wrong = cells[2].split(", ").filter(|wrong| !wrong.is_empty());
        let bare = |wrong| -> Vec<String> {
            let words = words(wrong, 1).into_iter();
            words.map(|(_, word)| word).collect()
        };
        Term {
            name: cells[0].to_owned(),
            wrong: wrong.map(bare).collect(),
        }
    });
    rows.collect()
}

/// The words of a text that begins on a line. A mark between words, or an escaped line end, ends a
/// phrase; the end of a line does not.
fn words(text: &str, first: usize) -> Vec<Word> {
    let is_mark = |c: char| !(c.is_alphanumeric() || "%'-_".contains(c));
    let mut found = Vec::new();
    for (line, text) in (first..).zip(text.lines()) {
        let text = text.to_lowercase().replace("\\n", "|");
        for piece in text
            .split_whitespace()
            .flat_map(|word| word.split_inclusive(is_mark))
        {
            let word = piece.trim_end_matches(is_mark).trim_matches(['\'', '-']);
            if !word.is_empty() {
                found.push((line, word.to_owned()));
            }
            // A string goes on after a backslash at the end of a line.
            if piece.ends_with(is_mark) && !piece.ends_with('\\') {
                found.push((line, "|".to_owned()));
            }
        }
    }
    found
}

/// Where words that are not to be written stand: file, line, the words, and the term for them.
fn broken(terms: &[Term], file: &str, words: &[Word]) -> Vec<String> {
    let pairs = terms
        .iter()
        .flat_map(|term| term.wrong.iter().map(move |wrong| (term, wrong)));
    let found = pairs.flat_map(|(term, wrong)| {
        let windows = words.windows(wrong.len());
        let same = windows.filter(move |window| window.iter().map(|(_, word)| word).eq(wrong));
        same.map(move |window| {
            let (line, said, name) = (window[0].0, wrong.join(" "), &term.name);
            format!("{file}:{line}: instead of {said:?} write {name:?}")
        })
    });
    found.collect()
}

/// The string literals of a file of Rust without its tests, each with its line; not those of
/// documentation, but those of other attributes.
fn strings(text: &str) -> Vec<(usize, String)> {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let mut found = Vec::new();
    collect_strings(text.parse().unwrap(), &mut found);
    let mut from = 0;
    // Their order is that of the text.
    let placed = found.into_iter().map(|literal| {
        let at = from + text[from..].find(&literal).unwrap();
        from = at + literal.len();
        (text[..at].matches('\n').count() + 1, literal)
    });
    placed.collect()
}

fn collect_strings(tokens: TokenStream, found: &mut Vec<String>) {
    for token in tokens {
        match token {
            TokenTree::Literal(literal) => {
                let literal = literal.to_string();
                found.extend(literal.contains('"').then_some(literal));
            }
            TokenTree::Group(group) => {
                let mut inside = group.stream().into_iter().map(|token| token.to_string());
                if inside.next().as_deref() != Some("doc") || inside.next().as_deref() != Some("=")
                {
                    collect_strings(group.stream(), found);
                }
            }
            TokenTree::Ident(_) | TokenTree::Punct(_) => {}
        }
    }
}

/// The files with one of these endings below a folder of the project.
fn with_endings(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for name in files::names(folder) {
        let path = folder.join(&name);
        let is_ours = name == ".github" || !(name.starts_with('.') || name == "target");
        if path.is_dir() && is_ours {
            found.extend(with_endings(&path, endings));
        } else if endings.iter().any(|ending| name.ends_with(ending)) {
            found.push(path);
        }
    }
    found
}

/// The words of a file of the page or of a document; not those of comments in scripts.
fn words_of(path: &Path) -> Vec<Word> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text
        .lines()
        .map(|line| match line.trim().starts_with("//") {
            true => "",
            false => line,
        });
    words(&lines.collect::<Vec<_>>().join("\n"), 1)
}

#[test]
fn page_messages_and_documents_use_the_terms_of_the_list() {
    let terms = terms(&fs::read_to_string(root().join(LIST)).unwrap());
    assert!(terms.len() >= TERMS, "{} terms", terms.len());
    let (mut all, mut read, mut heard) = (Vec::new(), 0, 0);
    let page = with_endings(&root().join("appliance/src/web/assets"), &[".html", ".js"]);
    for path in page.into_iter().chain(with_endings(&root(), &[".md"])) {
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        if !EXCEPTED.contains(&file.as_str()) {
            let words = words_of(&path);
            read += words.len();
            all.extend(broken(&terms, &file, &words));
        }
    }
    for folder in CRATES {
        for (file, text) in files_of(folder) {
            for (line, literal) in strings(&text) {
                heard += 1;
                let file = format!("{folder}/{file}");
                all.extend(broken(&terms, &file, &words(&literal, line)));
            }
        }
    }
    assert!(
        read > WORDS && heard > STRINGS,
        "{read} words, {heard} strings"
    );
    assert!(
        all.is_empty(),
        "One word, one meaning, by {LIST}:\n{}",
        all.join("\n")
    );
}

#[test]
fn a_word_that_is_not_written_is_found() {
    let terms = terms(
        "| term | means | not |\n|---|---|---|\n| coverage | a share | surface resolved, % of it |\n| cycle | one | |\n",
    );
    let names: Vec<_> = terms.iter().map(|term| &term.name).collect();
    assert_eq!(names, ["coverage", "cycle"]);
    let lines = |text: &str| -> Vec<usize> {
        let found = broken(&terms, "file", &words(text, 1));
        let line = |words: &String| words.split(':').nth(1).unwrap().parse().unwrap();
        found.iter().map(line).collect()
    };
    assert_eq!(lines("the\nSurface\nresolved, {:.1} % of it"), [2, 3]);
    assert_eq!(
        lines("<dt title=\"a 'surface resolved'\">surface resolved</dt>"),
        [1, 1]
    );
    assert!(
        lines("surfaces resolved; the surface. Resolved pixels\\nsurface | resolved").is_empty()
    );
    let code = "#![doc = \"a\"]\n/// b\n#[error(\"c \\\n d\")]\nfn f() { g('e', 1, \"h\\n\"); }\n\
                #[cfg(test)]\nmod tests { const I: &str = \"i\"; }";
    let found = strings(code);
    assert_eq!(found, [(3, "\"c \\\n d\"".into()), (5, "\"h\\n\"".into())]);
    assert_eq!(
        words(&found[0].1, 3)
            .iter()
            .filter(|(_, word)| word != "|")
            .count(),
        2
    );
}
