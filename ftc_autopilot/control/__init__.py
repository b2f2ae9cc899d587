"""The controller: reference, formation errors, laws, triggers."""
