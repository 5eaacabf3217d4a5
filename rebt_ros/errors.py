"""The errors that a user of the package can cause.

Every message is one sentence that names the thing at fault and says what to do.  Lower errors are
wrapped with ``raise ... from err`` at the border where their context is known; only commands and
nodes turn a `RebtError` into text, an exit code or a failed service response.
"""


class RebtError(Exception):
    """Root of all errors that a user can cause; anything else is a programming mistake."""


class InputError(RebtError):
    """What was shown (a bag, a recording, a table, a message) cannot be used."""


class OptionError(RebtError):
    """An option or parameter has a value that makes no sense."""


class DocumentError(RebtError):
    """A behavior tree document is malformed or does not fit where it should run."""
