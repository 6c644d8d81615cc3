//! System and scenario files.
