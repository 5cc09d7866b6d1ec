//! Openings of a part: places inside it where nothing was resolved when it was taught.

use super::mask::components;
use alloc::vec::Vec;

/// A connected set of unresolved pixels that does not touch the frame's border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opening {
    /// Number of pixels.
    pub pixels: usize,
    /// Mean (u, v).
    pub centre: (f64, f64),
    /// Half the extent of the largest upright diamond around the centre that holds no resolved
    /// pixel, in pixels.
    pub reach: usize,
}

/// Finds the openings of at least `min_pixels` in a row-major mask of resolved pixels, largest
/// first. Connected means sharing an edge.
pub fn openings(resolved: &[bool], width: usize, min_pixels: usize) -> Vec<Opening> {
    let rows = resolved.len() / width.max(1);
    let inside = |&place: &usize| {
        let (row, column) = (place / width, place % width);
        row > 0 && column > 0 && row + 1 < rows && column + 1 < width
    };
    let unresolved: Vec<bool> = resolved.iter().map(|resolved| !resolved).collect();
    let mut found: Vec<Opening> = components(&unresolved, width, false)
        .iter()
        .filter(|component| component.len() >= min_pixels && component.iter().all(inside))
        .filter_map(|component| opening(component, resolved, width))
        .collect();
    found.sort_by_key(|opening| core::cmp::Reverse(opening.pixels));
    found
}

/// `None` if the centre itself is resolved: no region fits into a ring.
fn opening(component: &[usize], resolved: &[bool], width: usize) -> Option<Opening> {
    let count = component.len() as f64;
    let (columns, rows) = component.iter().fold((0.0, 0.0), |(u, v), place| {
        (u + (place % width) as f64, v + (place / width) as f64)
    });
    let centre = (columns / count, rows / count);
    let (column, row) = (libm::rint(centre.0) as isize, libm::rint(centre.1) as isize);
    let height = (resolved.len() / width) as isize;
    let free = |du: isize, dv: isize| {
        let (u, v) = (column + du, row + dv);
        let inside = u >= 0 && v >= 0 && u < width as isize && v < height;
        inside && !resolved[v as usize * width + u as usize]
    };
    // Grow the diamond ring by ring until it meets something resolved.
    let clear = |ring: isize| {
        (0..=ring).all(|du| {
            let dv = ring - du;
            [(du, dv), (-du, dv), (du, -dv), (-du, -dv)]
                .into_iter()
                .all(|(du, dv)| free(du, dv))
        })
    };
    let reach = (0..).take_while(|&ring| clear(ring)).count();
    (reach > 0).then(|| Opening {
        pixels: component.len(),
        centre,
        reach: reach - 1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_found_and_the_surroundings_are_not() {
        const WIDTH: usize = 60;
        let resolved: Vec<bool> = (0..WIDTH * WIDTH)
            .map(|place| {
                let (u, v) = ((place % WIDTH) as i64, (place / WIDTH) as i64);
                let part = (5..55).contains(&u) && (5..55).contains(&v);
                let hole = (u - 20).pow(2) + (v - 30).pow(2) <= 64;
                let speck = u == 40 && v == 40;
                part && !hole && !speck
            })
            .collect();
        let found = openings(&resolved, WIDTH, 20);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].centre, (20.0, 30.0));
        assert_eq!(found[0].reach, 8);
        assert_eq!(openings(&resolved, WIDTH, 1).len(), 2);
        assert!(openings(&[false; 25], 5, 1).is_empty());
    }

    #[test]
    fn a_notch_at_any_border_of_the_frame_is_no_opening() {
        const WIDTH: usize = 20;
        for (u, v) in [(0, 8), (16, 8), (8, 0), (8, 16)] {
            let notch = |place| {
                let (column, row) = (place % WIDTH, place / WIDTH);
                (u..u + 4).contains(&column) && (v..v + 4).contains(&row)
            };
            let resolved: Vec<bool> = (0..WIDTH * WIDTH).map(|place| !notch(place)).collect();
            assert!(openings(&resolved, WIDTH, 1).is_empty(), "({u}, {v})");
        }
    }
}
