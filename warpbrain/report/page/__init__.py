"""How a report becomes one page that needs no network: frame, contents, tables, figures, a view in 3-D."""
