//! What a session believed when, and what each reading contributed.
