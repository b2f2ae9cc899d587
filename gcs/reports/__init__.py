"""Reports for people: tables and text on the terminal, Markdown and HTML."""
