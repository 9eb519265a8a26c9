"""Check a built site: no page asks another server for anything, and every entry has its page.

python docs/check_site.py SITE
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

ELSEWHERE = re.compile(r"^(?:https?:)?//", re.IGNORECASE)
IN_STYLES = re.compile(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")\s]+)", re.IGNORECASE)
LOADED_LINKS = {"stylesheet", "preload", "prefetch", "modulepreload", "icon", "manifest"}


class Requests(HTMLParser):
    """What a page loads by itself from elsewhere; links that a reader follows are no requests."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Look at the attributes that make a browser load something."""
        values = {name: value or "" for name, value in attrs}
        self.style = tag == "style"
        if tag == "link" and LOADED_LINKS & set(values.get("rel", "").split()):
            self.look(values.get("href", ""))
        if tag not in ("a", "link"):
            self.look(values.get("src", ""))
            self.look(values.get("data", "") if tag == "object" else "")
            for part in values.get("srcset", "").split(","):
                self.look(part.strip())
        self.found += IN_STYLES.findall(values.get("style", ""))
        if "srcdoc" in values:  # scenes are pages within the page
            inner = Requests()
            inner.feed(values["srcdoc"])
            self.found += inner.found

    def handle_data(self, data: str) -> None:
        """Look at the text of style elements."""
        if self.style:
            self.found += IN_STYLES.findall(data)
            self.style = False

    def look(self, address: str) -> None:
        """Note an address on another server."""
        if ELSEWHERE.match(address):
            self.found.append(address)


def requests(path: Path) -> list[str]:
    """Addresses on other servers that a file of the site makes a browser load."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix == ".css":
        return IN_STYLES.findall(text)
    page = Requests()
    page.feed(text)
    return page.found


def main(site: Path) -> None:
    """Say what was found; the exit code is 1 where something is wrong."""
    pages = sorted(site.rglob("*.html"))
    expected = {
        "index",
        "traps",
        "notebooks/07_identification",
        "book/chapter_1",
        "reference/errors",
    }
    missing = sorted(name for name in expected if site / f"{name}.html" not in pages)
    asked = {path: requests(path) for path in [*pages, *sorted(site.rglob("*.css"))]}
    wrong = [f"{name}.html is missing" for name in missing]
    for path, addresses in asked.items():
        wrong += [f"{path.relative_to(site)} loads {address}" for address in set(addresses)]
    if wrong:
        sys.exit("\n".join(wrong))
    sys.stdout.write(f"{len(pages)} pages, nothing loaded from elsewhere\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
