"""Solution of interface problems: the driver, the methods, their backends and preconditioners. No body is known here."""
