"""What `case.toml` may say: every table and key in one place, from which it is read, checked and described."""
