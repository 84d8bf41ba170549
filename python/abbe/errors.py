"""Errors of abbe."""


class Error(Exception):
    """A message of abbe.

    code: "bad_input", "usage", "refused", "data_insufficient", "io"; of Control.stop_machine() also
    "stop_not_confirmed" and "stop_not_sent".
    details: further lines, for example one for each fault of a file with file, line and field.
    """

    def __init__(self, code: str, text: str, details: list[str] | None = None):
        super().__init__("\n".join([text, *(details or [])]))
        self.code = code
        self.text = text
        self.details = list(details or [])
