//! Names: a type's stands for one thing in a crate, and a file's for few.

use crate::house::files_of;
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::BTreeMap;

/// The folders of the crates in which a name stands for one thing.
pub const CRATES: [&str; 6] = [
    "algo/src",
    "hal/src",
    "hal/sim/src",
    "appliance/src",
    "appliance/lab/src",
    "appliance/fleet/src",
];

/// Most files of one name in a crate.
const MAX_NAMESAKES: usize = 3;

#[test]
fn a_name_of_a_type_stands_for_one_thing_in_a_crate() {
    let rule = "One word, one meaning: no struct, enum, trait, union or type of a module has the name of \
                another one of its crate.";
    let mut broken = Vec::new();
    for folder in CRATES {
        let mut declared = BTreeMap::<String, Vec<String>>::new();
        // The back-ends of simd have the same names: one of them is compiled, or chosen at run time.
        let files = files_of(folder).into_iter();
        for (file, text) in files.filter(|(file, _)| !file.starts_with("simd/")) {
            for name in types(text.parse().unwrap()) {
                declared.entry(name).or_default().push(file.clone());
            }
        }
        assert!(!declared.is_empty(), "{folder} declares no type?");
        let twice = declared.into_iter().filter(|(_, files)| files.len() > 1);
        broken
            .extend(twice.map(|(name, files)| format!("{folder}: {name} in {}", files.join(", "))));
    }
    assert!(broken.is_empty(), "{rule}\n{}", broken.join("\n"));
}

#[test]
fn a_name_of_a_file_stands_at_most_three_times_in_a_crate() {
    let rule =
        format!("A file is found by its name: at most {MAX_NAMESAKES} of one name in a crate.");
    let mut broken = Vec::new();
    for folder in CRATES {
        let mut named = BTreeMap::<String, Vec<String>>::new();
        for (file, _) in files_of(folder) {
            let name = file.rsplit('/').next().unwrap_or_default();
            if !["mod.rs", "lib.rs"].contains(&name) {
                named.entry(name.to_owned()).or_default().push(file);
            }
        }
        let often = named
            .into_iter()
            .filter(|(_, files)| files.len() > MAX_NAMESAKES);
        broken.extend(often.map(|(_, files)| format!("{folder}: {}", files.join(", "))));
    }
    assert!(broken.is_empty(), "{rule}\n{}", broken.join("\n"));
}

/// The types that the modules in these tokens declare. Left out are those within functions, macros
/// and implementations, and items with a `cfg`: tests, and alternatives of which one is compiled.
fn types(tokens: TokenStream) -> Vec<String> {
    let mut found = Vec::new();
    let mut tokens = tokens.into_iter().peekable();
    let mut conditional = false;
    while let Some(token) = tokens.next() {
        let word = token.to_string();
        match (&token, word.as_str()) {
            (TokenTree::Punct(_), "#") => {
                tokens.next_if(|next| next.to_string() == "!");
                conditional |= tokens
                    .next_if(|next| matches!(next, TokenTree::Group(_)))
                    .is_some_and(|attribute| attribute.to_string().starts_with("[cfg"));
                continue;
            }
            (TokenTree::Ident(_), "struct" | "enum" | "trait" | "union" | "type") => {
                found.extend(
                    tokens
                        .next()
                        .map(|name| name.to_string())
                        .filter(|_| !conditional),
                );
            }
            (TokenTree::Ident(_), "mod") => {
                tokens.next();
                if let Some(TokenTree::Group(inside)) = tokens.peek()
                    && !conditional
                {
                    found.extend(types(inside.stream()));
                }
            }
            // What belongs to an item: its visibility, or the modifiers before its keyword.
            (TokenTree::Ident(_), "pub" | "unsafe" | "auto") => {
                tokens.next_if(|next| matches!(next, TokenTree::Group(_)));
                continue;
            }
            _ => {}
        }
        // To the end of the item.
        let mut last = Some(token);
        while !ends(last.as_ref()) {
            last = tokens.next();
        }
        conditional = false;
    }
    found
}

/// Whether an item ends with this token.
fn ends(token: Option<&TokenTree>) -> bool {
    match token {
        Some(TokenTree::Group(group)) => group.delimiter() == Delimiter::Brace,
        Some(TokenTree::Punct(mark)) => mark.as_char() == ';',
        Some(_) => false,
        None => true,
    }
}

#[test]
fn types_are_found_however_they_are_declared() {
    let text = "pub(crate) struct A<T>(T); #[derive(Debug)] enum B { X } fn f() { struct C; } mod m { type D = u8; }
                #[cfg(test)] mod tests { struct E; } #[cfg(unix)] struct F; impl A<u8> { type G = u8; } const H: [u8; 2] = [0; 2];
                bounded! { struct I { x: u8 } } pub unsafe trait J {} struct K { k: u8 } use a::{b, C}; pub type L = u8;";
    assert_eq!(types(text.parse().unwrap()), ["A", "B", "D", "J", "K", "L"]);
}
