//! Places labels near their dots, clear of everything else.

use super::{BOTTOM, LABEL, LEFT, LETTER, RIGHT, TOP};

/// x from, y from, x to, y to.
pub type Area = [f64; 4];

/// Marks the pixels of a line as taken.
pub fn block(taken: &mut Vec<Area>, from: (f64, f64), to: (f64, f64)) {
    let steps = (f64::hypot(to.0 - from.0, to.1 - from.1) / 4.0)
        .ceil()
        .max(1.0);
    for i in 0..=steps as usize {
        let share = i as f64 / steps;
        let x = from.0 + share * (to.0 - from.0);
        let y = from.1 + share * (to.1 - from.1);
        taken.push([x - 1.5, y - 1.5, x + 1.5, y + 1.5]);
    }
}

/// Where a label goes: the first place near its dot that is free; far from it with the end of a
/// line to it.
pub fn place(
    (x, y): (f64, f64),
    label: &str,
    left: bool,
    taken: &[Area],
) -> (Area, Option<(f64, f64)>) {
    let width = LETTER * label.chars().count() as f64 + 2.0;
    let area = |dx: f64, dy: f64| {
        let start = x + dx;
        [
            start,
            y + dy - LABEL / 2.0 - 0.5,
            start + width,
            y + dy + LABEL / 2.0 + 1.0,
        ]
    };
    let near = [
        (8.0, 0.0),
        (-8.0 - width, 0.0),
        (7.0, -11.0),
        (7.0, 11.0),
        (-width / 2.0, -14.0),
        (-width / 2.0, 14.0),
        (-7.0 - width, -11.0),
        (-7.0 - width, 11.0),
    ];
    let order: Vec<(f64, f64)> = if left {
        let steps = (0..8).map(|i| -width - 40.0 * f64::from(i));
        steps.flat_map(|dx| [(dx, -10.0), (dx, 10.0)]).collect()
    } else {
        near.to_vec()
    };
    let free = |area: &Area| {
        let inside =
            area[0] > LEFT + 3.0 && area[2] < RIGHT - 3.0 && area[1] > TOP && area[3] < BOTTOM;
        let clear = |other: &Area| {
            area[2] <= other[0] || other[2] <= area[0] || area[3] <= other[1] || other[3] <= area[1]
        };
        inside && taken.iter().all(clear)
    };
    if let Some(found) = order.iter().map(|&(dx, dy)| area(dx, dy)).find(free) {
        return (found, None);
    }
    // Further away, to the right in growing steps up and down.
    let far = (1..24).flat_map(|ring| {
        let step = 8.0 * f64::from(ring);
        [(26.0, -step), (26.0, step), (60.0, -step), (60.0, step)]
    });
    far.map(|(dx, dy)| area(dx, dy))
        .find(free)
        .map_or((area(8.0, 0.0), None), |found| {
            (found, Some((found[0] - 2.0, (found[1] + found[3]) / 2.0)))
        })
}
