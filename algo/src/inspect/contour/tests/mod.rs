//! Contours in rendered pictures: errors, noise, and what is found.

mod bits;
mod circles;
mod others;
mod placed;
mod scene;
mod states;
