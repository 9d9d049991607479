"""For each method the smallest problems on which it fails, searched for, and why it fails there."""
