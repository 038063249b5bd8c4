//! Tests: what an approach meets, what outcomes say, and how approaches are ranked.
