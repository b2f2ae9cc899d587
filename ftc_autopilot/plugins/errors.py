"""What is wrong with a plug-in."""


class PluginError(ValueError):
    """A plug-in cannot be used; one line that names its file and the line, as far as known."""
