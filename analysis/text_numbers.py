"""Numbers in text files."""


def is_number(word: str) -> bool:
    """Whether a word can be read as a number (``nan`` and ``inf`` can)."""
    try:
        float(word)
    except ValueError:
        return False
    return True
