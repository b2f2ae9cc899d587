"""How a program talks to its user: errors and exit statuses, texts, progress, files, signals."""
