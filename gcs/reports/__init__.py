"""What people read of results: tables for the terminal, and figures."""
