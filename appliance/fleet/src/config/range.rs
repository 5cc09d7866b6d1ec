//! Ranges in addresses: `{0001..0030}` stands for 30 numbers with four digits.

/// Every text that `text` stands for, at most `most`.
///
/// # Errors
/// If a range is wrong or there are too many, in words.
pub(super) fn expanded(text: &str, most: usize) -> Result<Vec<String>, String> {
    let mut all = vec![String::new()];
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once('{') {
        let (range, after) = behind.split_once('}').ok_or("close the range with }")?;
        let wrong = || format!("{{{range}}}: write a range as {{01..12}}");
        let (first, last) = range.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
        let (from, to) = (number(first)?, number(last)?);
        let count = to.checked_sub(from).ok_or_else(wrong)? as usize + 1;
        if count.saturating_mul(all.len()) > most {
            return Err(format!("it stands for more than {most}"));
        }
        let width = first.len();
        let longer = |start: &String| {
            let start = format!("{start}{before}");
            (from..=to).map(move |number| format!("{start}{number:0width$}"))
        };
        all = all.iter().flat_map(longer).collect();
        rest = after;
    }
    for text in &mut all {
        text.push_str(rest);
    }
    Ok(all)
}
