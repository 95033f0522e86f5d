"""What a lift can follow, and what it finds on one lane or on many."""
