//! From radiance to what a display shows.
