//! Sections of synthetic joints: errors, noise, and what is found.

mod joint;
mod measured;
mod states;
