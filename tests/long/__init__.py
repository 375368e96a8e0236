"""What takes longer than CI: other Pythons and systems, and the documents' commands (`./dev test --long`)."""
