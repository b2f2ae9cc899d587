"""The subcommands of ``gcs``, one module each: options in, words and exit status out."""
