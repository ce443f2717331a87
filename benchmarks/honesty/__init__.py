"""Is sigma honest with errors that the model does not have? One script for each procedure; each prints a table of its cases."""
