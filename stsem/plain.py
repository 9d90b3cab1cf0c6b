"""Names of strangers, made fit to be shown: topics, frames, classes and files may be called anything."""

MAX_NAME = 120
MAX_SENTENCE = 4000


def plain(text: str, limit: int = MAX_NAME) -> str:
    r"""`text` on one line, of at most `limit` characters: what does not print stands as an escape such as `\x1b`.

    That covers control characters, line breaks of all kinds, marks that turn the direction of writing, and bytes that
    were no text. A text that is fine already comes back as it is.
    """
    if len(text) > limit:
        text = text[: limit - 3] + "..."
    if text.isprintable():
        return text
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return shown if len(shown) <= limit else shown[: limit - 3] + "..."
