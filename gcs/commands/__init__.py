"""The command line ``gcs``, one module for each command: options in, output and exit status out."""
