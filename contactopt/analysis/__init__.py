"""What is asked of scenes: solving them, finding their contact zones, reading quantities, following load paths."""
