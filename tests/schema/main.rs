//! System and scenario files: no mistake in them passes silently, and their JSON Schema says what the loader says.

#[path = "../support/mod.rs"]
mod support;

mod editor;
mod mutate;
mod silent;
