//! Clear bodies that touch, lie in one another or hold the eye; what a shadow ray crosses.
