//! Home of the black-box tests in `whole/`; the crate itself has nothing to offer.
