"""The classics with error bars."""
