//! Contours in rendered pictures: errors, noise, and what is found.

mod circles;
mod others;
mod placed;
mod scene;
mod states;
