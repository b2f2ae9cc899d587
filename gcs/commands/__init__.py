"""The subcommands of ``gcs``, one module each: options in, output and exit status out."""
