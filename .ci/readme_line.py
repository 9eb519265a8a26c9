"""Print the one command of the README's fenced block under the heading that contains a word."""

import re
import sys
from pathlib import Path


def main(readme: str, word: str) -> None:
    """Print the command, or end with a sentence that says what the README lacks."""
    text = Path(readme).read_text(encoding="utf-8")
    blocks: list[list[str]] = []
    wanted = False
    block: list[str] | None = None
    for line in text.splitlines():
        if line.lstrip().startswith("```"):
            if block is not None and wanted:
                blocks.append(block)
            block = [] if block is None else None
        elif block is not None:
            block.append(line)
        elif re.match(r"#+ ", line):
            wanted = re.search(rf"\b{word}", line, re.IGNORECASE) is not None
    if not blocks:
        sys.exit(f"{readme} has no fenced block under a heading that contains '{word}'")
    commands = [line for line in blocks[0] if line.strip()]
    if len(commands) != 1:
        sys.exit(f"the block under '{word}' in {readme} has {len(commands)} lines instead of one")
    print(commands[0])


main(*sys.argv[1:])
