"""The statements of a file: keywords with a value or a list, each with its line."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path

from ..errors import ParFileError, nearest_names
from .expressions import Entry, parsed
from .keywords import KEYWORDS, REQUIRED, SCALARS

_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
_ROBOT_NAME = re.compile(r"\(\*\s*Robotname\s*=\s*(['\"])(.*?)\1", re.IGNORECASE)
_HEAD = re.compile(r"(\w+)\s*=[ \t]*")
_BLANKS = re.compile(r"\s*")
_MOST_UNKNOWN = 200
_MOST_ENTRIES = 5000
_LARGEST = 4 * 2**20
"""Bytes; the files of SYMORO have a few thousand."""


class ParFile:
    """The statements of a file, with nothing evaluated yet."""

    def __init__(self, path: Path) -> None:
        self.label = path.name or str(path)
        text = decoded(path)
        named = _ROBOT_NAME.search(text)
        self.name = (named[2].strip() if named else "") or path.stem
        text = _COMMENT.sub(lambda found: " " + "\n" * found[0].count("\n"), text)
        if "(*" in text:
            line = text.count("\n", 0, text.index("(*")) + 1
            raise self.error("a comment that begins with (* has no end: close it with *).", line)
        # the line break alone continues a list, so a backslash in front of it can go
        self._text = re.sub(r"\\[ \t]*(?=\n)", "", text)
        self._starts = [0, *(found.end() for found in re.finditer("\n", self._text))]
        self._scalars: dict[str, tuple[str, int]] = {}
        self._lists: dict[str, tuple[Entry, ...]] = {}
        self._lines: dict[str, int] = {}
        self.unknown: list[str] = []
        seen: dict[str, str] = {}
        for word, body, line, start in self._statements():
            keyword = KEYWORDS.get(word.lower())
            if keyword is None:
                self.unknown.append(word)
                if len(self.unknown) > _MOST_UNKNOWN:
                    raise self.error(
                        f"over {_MOST_UNKNOWN} words that are no keywords, like {word!r:.60}. "
                        "Is this a .par file of SYMORO?",
                        line,
                    )
                continue
            flat = "".join(body.split())
            if seen.setdefault(keyword, flat) != flat:
                raise self.error(
                    f"{keyword} stands here again, with other entries than on line "
                    f"{self._lines[keyword]}; keep one of the two.",
                    line,
                )
            self._lines[keyword] = line
            self._store(keyword, body, line, start)
        self.names = {s for entries in self._lists.values() for e in entries for s in e.symbols}
        missing = [keyword for keyword in REQUIRED if keyword not in self._lines]
        if missing:
            close = [near for k in missing for near in nearest_names(k, self.unknown)]
            raise self.error(
                f"expected the keywords {', '.join(missing)}, which are not there"
                + (f" ({', '.join(map(repr, dict.fromkeys(close)))} is none)" if close else "")
                + "; a .par file of SYMORO holds lists such as ant = {0, 1, 2}."
            )

    def error(self, message: str, line: int | None = None) -> ParFileError:
        """An error that names the file and the line."""
        return ParFileError(f"{self.label}{f', line {line}' if line else ''}: {message}")

    def line(self, keyword: str) -> int | None:
        """Number of the line of a keyword; None if it is not there."""
        return self._lines.get(keyword)

    def integer(self, keyword: str, default: int) -> int:
        """A whole number that stands alone, such as NL."""
        if keyword not in self._scalars:
            return default
        text, line = self._scalars[keyword]
        if not re.fullmatch(r"\d{1,6}", text):
            raise self.error(f"{keyword}: expected a whole number, got {text!r}.", line)
        return int(text)

    def flag(self, keyword: str) -> bool:
        """A keyword that is True or False."""
        text, line = self._scalars.get(keyword, ("0", 0))
        if text.lower() not in ("0", "1", "true", "false"):
            raise self.error(f"{keyword}: expected True or False, got {text!r}.", line)
        return text.lower() in ("1", "true")

    def entries(self, keyword: str, count: int, why: str) -> tuple[Entry, ...]:
        """Entries of a list, as many as expected, or none if it is not there."""
        entries = self._lists.get(keyword, ())
        if entries and len(entries) != count:
            raise self.error(
                f"{keyword}: expected {count} entries ({why}), got {len(entries)}.",
                self.line(keyword),
            )
        return entries

    def all_entries(self, keyword: str) -> tuple[Entry, ...]:
        """Entries of a list, as many as there are."""
        return self._lists.get(keyword, ())

    def _statements(self) -> Iterator[tuple[str, str, int, int]]:
        """Keyword, body, line and start of the body; the body of a list keeps its braces."""
        text, at = self._text, 0
        while True:
            while at < len(text) and (text[at].isspace() or text[at] == ";"):
                at += 1
            if at == len(text):
                return
            line = self._line_at(at)
            head = _HEAD.match(text, at)
            if head is None:
                got = text[at:].split("\n", 1)[0].strip()
                raise self.error(
                    f"expected 'keyword = ...', got {got[:60]!r}. Is this a .par file of SYMORO? "
                    "Comments stand between (* and *).",
                    line,
                )
            start = head.end()
            blanks = _BLANKS.match(text, start)
            bare = blanks.end() if blanks else start
            if text.startswith("{", bare):
                start = bare
                end = text.find("}", start) + 1
                if end == 0 or re.search(r"[={]", text[start + 1 : end - 1]):
                    raise self.error(f"the list {head[1]} has no end: close it with }}.", line)
            else:
                end = text.find("\n", start)
                end = len(text) if end < 0 else end
            yield head[1], text[start:end], line, start
            at = end

    def _line_at(self, place: int) -> int:
        return bisect_right(self._starts, place)

    def _store(self, keyword: str, body: str, line: int, start: int) -> None:
        is_list = body.startswith("{")
        if keyword in SCALARS:
            if is_list:
                raise self.error(f"{keyword}: expected one value, got a list.", line)
            self._scalars[keyword] = (body.strip(" \t\r;,"), line)
            return
        if not is_list:
            raise self.error(
                f"{keyword}: expected a list in braces such as {{0, 1}}, got {body.strip()!r}.",
                line,
            )
        texts = split_entries(body[1:-1])
        if len(texts) > _MOST_ENTRIES:
            raise self.error(
                f"{keyword}: {len(texts)} entries; at most {_MOST_ENTRIES} are read.", line
            )
        entries, at = [], start + 1
        for i, text in enumerate(texts, start=1):
            # white space before an entry may hold line breaks
            first = at + len(text) - len(text.lstrip())
            here = self._line_at(first)
            entries.append(parsed(text, f"{self.label}, line {here}: {keyword}, entry {i}"))
            at += len(text) + 1
        self._lists[keyword] = tuple(entries)


def decoded(path: Path) -> str:
    """Text of a file with lines that end in one way."""
    try:
        with path.open("rb") as file:
            raw = file.read(_LARGEST + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ParFileError(
            f"cannot read {str(path)!r}: {reason}. Give the path of a .par file."
        ) from None
    if len(raw) > _LARGEST:
        raise ParFileError(
            f"{path.name}: it is larger than {_LARGEST} bytes. Is this a .par file of SYMORO?"
        )
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # SYMORO+ signs with an accent
    if "\0" in text:
        raise ParFileError(f"{path.name}: this is not text, so not a .par file of SYMORO.")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def split_entries(body: str) -> list[str]:
    """Split at the commas outside parentheses: atan2(y, x) is one entry."""
    parts, depth = [""], 0
    for letter in body:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
