//! The page's own files.

use super::*;

#[tokio::test]
async fn the_page_comes_whole_from_this_device_and_allows_nothing_inline() {
    let served = served().await;
    let page = served.get("/").await;
    assert_eq!(page.status, 200);
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.starts_with("default-src 'self'"), "{policy}");
    assert!(!policy.contains("unsafe"), "{policy}");
    for needle in ["style=", "onclick", "<style", "javascript:"] {
        assert!(!page.body.contains(needle), "the page contains {needle}");
    }
    for asset in assets::ALL {
        let text = asset.text().replace("http://www.w3.org/2000/svg", "");
        for needle in ["http://", "https://", "eval(", "innerHTML"] {
            assert!(!text.contains(needle), "{} contains {needle}", asset.path);
        }
        assert_eq!(served.get(asset.path).await.status, 200, "{}", asset.path);
    }
}

#[test]
fn every_file_that_the_page_names_is_there_and_every_file_is_named() {
    let texts: Vec<&str> = assets::ALL.iter().map(assets::Asset::text).collect();
    let all = texts.join("\n");
    for asset in assets::ALL.iter().filter(|asset| asset.path != "/") {
        let named = all.contains(&format!("\"{}\"", &asset.path[1..]))
            || all.contains(&format!("\".{}\"", asset.path));
        assert!(named, "nobody names {}", asset.path);
    }
    // Behind a proxy the page may be under a path: nothing is asked for from the root.
    for root in ["\"/api", "`/api", "\"/events", "href=\"/", "src=\"/"] {
        assert!(!all.contains(root), "{root}");
    }
    for rest in all.split("from \".").skip(1) {
        let path = rest.split('"').next().unwrap();
        assert!(
            assets::ALL.iter().any(|asset| asset.path == path),
            "no file {path}"
        );
    }
}

#[test]
fn every_element_that_a_script_names_is_on_the_page() {
    let page = assets::ALL[0].text();
    let mut found = 0;
    for asset in assets::ALL
        .iter()
        .filter(|asset| asset.path.ends_with(".js"))
    {
        for call in ["$(\"", "text(\"", "show(\""] {
            for (at, _) in asset.text().match_indices(call) {
                let before = asset.text()[..at].chars().next_back();
                if before.is_some_and(char::is_alphanumeric) {
                    continue;
                }
                let id = asset.text()[at + call.len()..].split('"').next().unwrap();
                let there = page.contains(&format!("id=\"{id}\""));
                assert!(there, "{} names {id}", asset.path);
                found += 1;
            }
        }
    }
    assert!(found > 30, "{found}");
}

/// What browsers of 2018 do not know yet: an old tablet must show a verdict, not an empty page.
const TOO_NEW: [&str; 6] = [
    "?.",
    "??",
    "replaceChildren",
    ".flat(",
    "structuredClone",
    "replaceAll",
];

#[test]
fn the_scripts_stay_within_what_old_tablets_understand() {
    for asset in assets::ALL
        .iter()
        .filter(|asset| asset.path.ends_with(".js"))
    {
        let code: String = asset
            .text()
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect();
        for new in TOO_NEW {
            assert!(!code.contains(new), "{} uses {new}", asset.path);
        }
    }
}

#[test]
fn the_editor_has_no_list_of_characteristics_units_or_parameters() {
    let table = crate::recipe::file::kinds::json();
    let list = |key: &str| table[key].as_array().unwrap().clone();
    let word = |of: &Value, key: &str| of[key].as_str().unwrap().to_owned();
    let mut words: Vec<String> = list("units").iter().map(|of| word(of, "unit")).collect();
    for kind in list("kinds") {
        words.push(word(&kind, "kind"));
        let parameters = kind["parameters"].as_array().unwrap();
        words.extend(parameters.iter().map(|of| word(of, "name")));
    }
    // Axes have single letters; a feature is found, and limits have a nominal value.
    words.retain(|word| word.len() > 1 && !["found", "nominal"].contains(&word.as_str()));
    let editor = assets::ALL
        .iter()
        .filter(|asset| asset.path.starts_with("/editor"));
    for (asset, word) in editor.flat_map(|asset| words.iter().map(move |word| (asset, word))) {
        let named = asset.text().contains(&format!("\"{word}\""));
        assert!(!named, "{} names {word}", asset.path);
    }
    assert!(words.len() > 20, "{words:?}");
}
