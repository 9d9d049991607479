"""Files: written whole or not at all, and TOML whose messages name the line."""
