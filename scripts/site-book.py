#!/usr/bin/env python3
"""Writes the sources of the site's book: every Markdown page of the repository at its own path, and a summary of them.

scripts/site-book.py FOLDER

Links to pages and pictures stay as they are; those to other files of the repository lead to its host. A link to a file or a
heading that does not exist is an error. `scripts/site.sh` builds the book.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORKSPACE = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]
HOST = WORKSPACE["package"]["repository"] + "/blob/main/"
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
# Parts of the book after the guide, each with its pages in this order; a folder stands for its pages by name.
PARTS = {
    "Reference": ["docs/commands", "docs"],
    "Parts": ["crates", "web/package", "bench", "embedded", "boards"],
    "The project": ["ARCHITECTURE.md", "NOTATION.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md", "CHANGELOG.md"],
    "Notes": ["docs/notes"],
}


def pages():
    """Markdown files that are kept in the repository, but for templates and the paper."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    apart = re.compile(r"(^|/)(\.github|templates|examples|paper)/|introduction\.md$|preset-findings\.md$")
    return [name for name in listed.stdout.splitlines() if not apart.search(name) and name != "guide/src/SUMMARY.md"]


def relinked(text, page, kept):
    """The page with links that the book can follow."""

    def link(found):
        to = found[2]
        if re.match(r"[a-z]+:", to):
            return found[0]
        if to.startswith("#") and to[1:] not in anchors(page):
            sys.exit(f"{page}: expected a heading of this page, found a link to {to}")
        if to.startswith("#"):
            return found[0]
        path, _, anchor = to.partition("#")
        name = os.path.normpath(os.path.join(os.path.dirname(page), path))
        if not (ROOT / name).exists():
            sys.exit(f"{page}: expected a file of the repository, found a link to {to}")
        if anchor and name.endswith(".md") and anchor not in anchors(name):
            sys.exit(f"{page}: expected a heading of {name}, found a link to {to}")
        if name == "guide/src/SUMMARY.md":
            name, path = "guide/src/record.md", path.replace("SUMMARY.md", "record.md")
        # mdBook writes README.md as index.html, and links to it as they are.
        path = re.sub(r"(^|/)README\.md$", r"\1index.html", path) if name in kept else path
        if name in kept or name.endswith((".png", ".svg")):
            return found[1] + path + ("#" + anchor if anchor else "") + found[3]
        return found[1] + HOST + name + found[3]

    return LINK.sub(link, text)


@cache
def anchors(page):
    """Anchors of a page's headings, as hosts and mdBook make them, and those that are written out."""
    text = re.sub(r"^```.*?^```", "", (ROOT / page).read_text(), flags=re.M | re.S)
    headings = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading) for heading in re.findall(r"^#+ (.+?)\s*$", text, re.M)]
    slugs = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
    return {*slugs, *re.findall(r'<a (?:id|name)="([^"]+)"', text)}


def title(page):
    heading = re.search(r"^# (.+)$", (ROOT / page).read_text(), re.M)
    return re.sub(r"[`\[\]]", "", heading[1]) if heading else page


def summary(kept):
    """SUMMARY.md: the front page, the guide's own summary, then the other parts."""
    guide = (ROOT / "guide/src/SUMMARY.md").read_text().replace("# Summary", "# Guide").replace("](", "](guide/src/")
    lines = ["# Summary", "", "[ohmstrain](README.md)", "[API of the crates](api.md)", "", guide]
    left = [page for page in kept if not page.startswith("guide/") and page != "README.md"]
    for part, places in PARTS.items():
        lines += ["", f"# {part}", ""]
        for place in places:
            of_place = sorted(
                page for page in left if page == place or page.startswith(place + "/") and (place not in ("docs",) or page.count("/") == 1)
            )
            of_place.sort(key=lambda page: not page.endswith("/README.md"))
            left = [page for page in left if page not in of_place]
            lines += [f"- [{title(page)}]({page})" for page in of_place]
    if left:
        sys.exit(f"pages that no part of the book has: {' '.join(left)}")
    return "\n".join(lines) + "\n"


def api():
    """Links to the pages of cargo doc."""
    crates = sorted(tomllib.loads(manifest.read_text())["package"]["name"] for manifest in ROOT.glob("crates/*/Cargo.toml"))
    apart = ("ohmstrain-python", "ohmstrain-web", "ohmstrain-cli")
    names = [(name, name.replace("-", "_")) for name in crates if name not in apart]
    return "# API of the crates\n\n" + "\n".join(f"- [`{name}`](api/{module}/index.html)" for name, module in names) + "\n"


def main(folder):
    folder = Path(folder)
    if folder.exists():
        if not (folder / "book.toml").exists():
            sys.exit(f"{folder}: expected a folder that this program has written, or none")
        shutil.rmtree(folder)
    source = folder / "src"
    kept = pages()
    for page in kept:
        place = source / page
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(relinked((ROOT / page).read_text(), page, kept))
    for picture in (*ROOT.glob("docs/*.png"), *ROOT.glob("docs/*.svg")):
        shutil.copy(picture, source / "docs")
    (source / "api.md").write_text(api())
    (source / "SUMMARY.md").write_text(summary(kept))
    (folder / "book.toml").write_text('[book]\ntitle = "ohmstrain"\nlanguage = "en"\n\n[output.html.print]\nenable = false\n')


if len(sys.argv) != 2:
    sys.exit(__doc__)
main(sys.argv[1])
